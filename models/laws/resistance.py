"""Environmental resistance of the nose and normal load of the capsule in the stretched gut (paper V Eq. 7, 8, 12)."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.laws.geometry import GRAVITY, Capsule, Tissue, relaxed_diameter
from models.laws.hoop import Moduli, blend_weight, high_speed_moduli, hoop_stress, low_speed_moduli

Regime = Literal["low", "high", "blend"]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_SLOWEST = 1e-9  # m/s; below it the law has its limit of rest, where only E3 is left


def _pressure_integral(speed: NDArray[np.float64], start: float, end: float, capsule: Capsule, tissue: Tissue, regime: str) -> NDArray[np.float64]:
    """`int 2 pi R P dx` from `start` to `end` (m from first contact) in N, for each speed."""
    R = capsule.radius_m
    shoulder = R * math.sin(tissue.alpha)
    x = 0.5 * (end - start) * (_NODES + 1) + start
    w = 0.5 * (end - start) * _WEIGHTS
    D = np.where(x < shoulder, 2 * np.sqrt(R**2 - np.clip(shoulder - x, 0, None) ** 2), 2 * R)
    D0 = relaxed_diameter(capsule, tissue)
    e = (D - D0) / D0
    moduli: Moduli = low_speed_moduli(e) if regime == "low" else high_speed_moduli()
    v = np.maximum(np.abs(speed), _SLOWEST)[..., None]
    P = 2 * tissue.wall_thickness_m * hoop_stress(e, x, v, moduli) / D
    return np.asarray((2 * math.pi * R * P) @ w)


def pressure_integrals(speed: ArrayLike, capsule: Capsule, tissue: Tissue, regime: Regime = "low") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`I1` (nose) and `I2` (cylinder) of `2 pi R P dx` in N at `speed` in m/s, any shape.

    `P = 2 l_m tau/D`. The nose runs over 0..x_s, x_s = R sin(alpha), the cylinder over x_s..x_s + L. `regime` takes the low-speed or
    the high-speed moduli or blends the two results about 20 mm/s. Gauss quadrature, 64 nodes, relative error below 1e-8.
    """
    v = np.asarray(speed, dtype=float)
    shoulder = capsule.radius_m * math.sin(tissue.alpha)
    spans = ((0.0, shoulder), (shoulder, shoulder + capsule.cylinder_length_m))
    if regime != "blend":
        nose, cylinder = (_pressure_integral(v, a, b, capsule, tissue, regime) for a, b in spans)
        return nose, cylinder
    share = blend_weight(np.abs(v))
    low = pressure_integrals(v, capsule, tissue, "low")
    high = pressure_integrals(v, capsule, tissue, "high")
    return (1 - share) * low[0] + share * high[0], (1 - share) * low[1] + share * high[1]


def environmental_resistance(speed: ArrayLike, capsule: Capsule, tissue: Tissue, regime: Regime = "low") -> NDArray[np.float64]:
    """`F_e(v) = sin(theta) I1` in N: what the stretched wall in front of the nose resists (paper V Eq. 8)."""
    return math.sin(tissue.theta) * pressure_integrals(speed, capsule, tissue, regime)[0]


def normal_load(speed: ArrayLike, capsule: Capsule, tissue: Tissue, regime: Regime = "low") -> NDArray[np.float64]:
    """`N(v) = m g + cos(theta) I1 + I2` in N: weight, nose and cylinder press on the wall (paper V Eq. 12)."""
    nose, cylinder = pressure_integrals(speed, capsule, tissue, regime)
    return capsule.mass_kg * GRAVITY + math.cos(tissue.theta) * nose + cylinder


def coulomb_limit(speed: ArrayLike, capsule: Capsule, tissue: Tissue, regime: Regime = "low") -> NDArray[np.float64]:
    """`f_c = mu N` in N: the tension at which the wall slips (paper V Eq. 11)."""
    return tissue.friction_coefficient * normal_load(speed, capsule, tissue, regime)
