"""Two magnets as dipoles: pull along the lumen, attraction across it, and how far finite cylinders are from them.

Both moments are fixed and lie either `across` the lumen, on one axis where the outer magnet stands above the capsule
(coaxial), or `along` it, opposite to each other (parallel, side by side). With the gap g along the lumen, the height h
across it between the centres, q = (g/h)^2 and C = mu_0 m_1 m_2/(4 pi), the energies -C (2 h^2 - g^2)/r^5 (across) and
-C (h^2 - 2 g^2)/r^5 (along), r^2 = g^2 + h^2, have the gradients

    pull        k g (1 - a q)/(1 + q)^(7/2),    k = 12 C/h^5, a = 1/4 (across);  9 C/h^5, 2/3 (along)
    attraction  k h/b (1 - c q)/(1 + q)^(7/2),  b = 2, c = 3/2 (across);         3, 4 (along)

Source: K. W. Yung et al., Magn. Electr. Sep. 9 (1998) 39, Eq. 8 (force between two dipoles).
"""

import math
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Orientation = Literal["across", "along"]
MU_0: Final = 4e-7 * math.pi  # V s/(A m)
_RADII, _ANGLES = 8, 32  # of the points on a magnet's end face


@dataclass(frozen=True)
class Pairing:
    """Numbers of one orientation: stiffness `k h^5/C`, ratio `b` of `k h` to the attraction, `a` and `c` of the laws,
    and the `peak`, the gap of greatest pull over the height.
    """

    stiffness: float
    b: float
    a: float
    c: float
    peak: float


PAIRINGS: Final[dict[str, Pairing]] = {
    "across": Pairing(12.0, 2.0, 1 / 4, 3 / 2, math.sqrt((27 - math.sqrt(665)) / 8)),
    "along": Pairing(9.0, 3.0, 2 / 3, 4.0, math.sqrt((24 - math.sqrt(480)) / 16)),
}


def moment_A_m2(remanence_T: float, diameter_m: float, length_m: float) -> float:
    """`B_r V/mu_0` of a cylinder that is magnetised along its axis."""
    return remanence_T * math.pi / 4 * diameter_m**2 * length_m / MU_0


def stiffness_N_per_m(moments: float, height_m: float, orientation: Orientation) -> float:
    """`k`, the slope of the pull at no gap; `moments` is the product of both in A^2 m^4."""
    return PAIRINGS[orientation].stiffness * MU_0 / (4 * math.pi) * moments / height_m**5


def pull(gap: Any, stiffness: Any, height: Any, orientation: Orientation) -> Any:
    """Force in N on the capsule along the lumen towards the magnet; `gap` and `height` in m, `stiffness` in N/m."""
    q = (gap / height) ** 2
    return stiffness * gap * (1 - PAIRINGS[orientation].a * q) / (1 + q) ** 3.5


def attraction(gap: Any, stiffness: Any, height: Any, orientation: Orientation) -> Any:
    """Force in N on the capsule across the lumen towards the magnet; 0 where the dipoles repel each other (at gaps of
    more than 0.8 h across, 0.5 h along).
    """
    pairing = PAIRINGS[orientation]
    q = (gap / height) ** 2
    return stiffness * height / pairing.b * np.maximum(1 - pairing.c * q, 0.0) / (1 + q) ** 3.5


@dataclass(frozen=True)
class Cylinder:
    """A magnet that is magnetised along its axis."""

    diameter_m: float
    length_m: float

    def charges(self, along: Array) -> tuple[Array, Array]:
        """Points (n, 3) in m of both end faces, the axis along the unit vector `along`, and their shares (n,) of moment
        over length: Gauss points over the radius, even ones around.
        """
        node, weight = np.polynomial.legendre.leggauss(_RADII)
        radius = 0.5 * self.diameter_m * np.sqrt(0.5 * (node + 1))
        angle = 2 * math.pi * np.arange(_ANGLES) / _ANGLES
        one = np.roll(along, 1)
        other = np.cross(along, one)
        face = (radius[:, None, None] * (np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * other)).reshape(-1, 3)
        share = np.repeat(0.5 * weight / _ANGLES, _ANGLES) / self.length_m
        shift = 0.5 * self.length_m * along
        return np.vstack([face + shift, face - shift]), np.concatenate([share, -share])


def cylinder_forces(
    outer: Cylinder, inner: Cylinder, moments: float, gap_m: float, height_m: float, orientation: Orientation
) -> tuple[float, float]:
    """Pull and attraction in N between two finite cylinders, from the charges on their end faces."""
    axis = np.array([0.0, 0.0, 1.0] if orientation == "across" else [1.0, 0.0, 0.0])
    far, far_charge = outer.charges(axis)
    near, near_charge = inner.charges(axis if orientation == "across" else -axis)
    apart = near[:, None, :] - (far + np.array([gap_m, 0.0, height_m]))[None, :, :]
    charge = near_charge[:, None] * far_charge[None, :] / np.sum(apart**2, axis=2) ** 1.5
    force = MU_0 / (4 * math.pi) * moments * np.einsum("ij,ijk->k", charge, apart)
    return float(force[0]), float(force[2])


def too_strong(outer: Cylinder, inner: Cylinder, height_m: float, orientation: Orientation) -> float:
    """Relative error of the dipoles at `height_m`, of pull or attraction, whichever is larger, at half the greatest
    pull; positive where they are too strong.
    """
    gap = 0.25 * PAIRINGS[orientation].peak * height_m
    k = stiffness_N_per_m(1.0, height_m, orientation)
    dipoles = pull(gap, k, height_m, orientation), attraction(gap, k, height_m, orientation)
    cylinders = cylinder_forces(outer, inner, 1.0, gap, height_m, orientation)
    return max((float(a) / b - 1 for a, b in zip(dipoles, cylinders, strict=True)), key=abs)
