"""Hyperelastic intestine wall, lengthwise and around, and its tension (paper A Eq. 1-3, 12, after Ciarletta 2009)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.parameter import load_set


@dataclass(frozen=True)
class WallConstants:
    """Constants of the hyperelastic wall: stresses in Pa, the exponents k2* dimensionless (A and C, Table 1)."""

    c1_Pa: float
    k1_coll_Pa: float
    k2_coll: float
    k1_cm_Pa: float
    k2_cm: float
    k1_lm_Pa: float
    k2_lm: float

    @classmethod
    def from_set(cls) -> WallConstants:
        """Read the printed constants."""
        s = load_set("zhang2016_analytical")
        return cls(*(s[key] for key in cls.__dataclass_fields__))


def _stress(stretch: Any, invariant: Any, factor: Any, k1_Pa: float, k2: float, wall: WallConstants) -> Any:
    """Matrix, collagen and a muscle with the constants `k1_Pa` and `k2`."""
    strain = stretch**2 - 1
    collagen = factor * wall.k1_coll_Pa * (invariant - 1) * np.exp(wall.k2_coll * (invariant - 1) ** 2)
    return wall.c1_Pa * (1 - stretch**-4) + collagen + k1_Pa * strain * np.exp(k2 * strain**2)


def longitudinal_stress(stretch: Any, wall: WallConstants) -> Any:
    """Stress along the gut, the sum of matrix, collagen and longitudinal muscle, with `I = (3 l^4 + 1)/(4 l^2)`:

    `H_l(l) = c1 (1 - l^-4) + (3 l^4 - 1)/(2 l^4) k1 (I - 1) exp(k2 (I - 1)^2) + kLM1 (l^2 - 1) exp(kLM2 (l^2 - 1)^2)`.

    `stretch` l is dimensionless, any shape; the stress is in Pa, same shape. Valid for stretches of about 1 to 1.6, the
    range of Ciarletta's tests. Source: paper A Eq. 1 and 3 (Eq. 18-20 of A do *not* follow from it).
    """
    invariant = (3 * stretch**4 + 1) / (4 * stretch**2)
    factor = (3 * stretch**4 - 1) / (2 * stretch**4)
    return _stress(stretch, invariant, factor, wall.k1_lm_Pa, wall.k2_lm, wall)


def circumferential_stress(stretch: Any, wall: WallConstants) -> Any:
    """Stress around the gut, the sum of matrix, collagen and circular muscle, with `I = (l^4 + 3)/(4 l^2)`:

    `H_c(l) = c1 (1 - l^-4) + (l^4 - 3)/(2 l^4) k1 (I - 1) exp(k2 (I - 1)^2) + kCM1 (l^2 - 1) exp(kCM2 (l^2 - 1)^2)`.

    `stretch` l is dimensionless, any shape; the stress is in Pa, same shape. Source: paper A Eq. 2 and 3.
    """
    invariant = (stretch**4 + 3) / (4 * stretch**2)
    factor = (stretch**4 - 3) / (2 * stretch**4)
    return _stress(stretch, invariant, factor, wall.k1_cm_Pa, wall.k2_cm, wall)


def wall_tension(u: Any, wall: WallConstants, section_m2: float, stretched_length_m: float) -> Any:
    """`T(u) = sign(u) H_l(1 + |u|/L_s) s` in N of the wall that the capsule has dragged along by `u` in m (any shape),
    section `s` in m^2, stretched length `L_s` in m.

    Odd in `u`; 38.2 mN at 0.25 mm and 163.2 mN at 1 mm for the default capsule. Source: paper A Eq. 12.
    """
    return np.sign(u) * longitudinal_stress(1 + np.abs(u) / stretched_length_m, wall) * section_m2
