"""Stick-slip at constant speed in a hyperelastic gut as paper A draws it: resistance and limit, teeth (Eq. 6-20)."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from models.laws.geometry import Capsule, Tissue, relaxed_diameter, shoulder_position, wall_diameter
from models.laws.hyperelastic import WallConstants, circumferential_stress, wall_tension
from models.laws.resistance import integrate_along
from models.parameter import load_set

Tension = Callable[[Any], Any]
"""Tension in N of a wall dragged along by u in m."""


@dataclass(frozen=True)
class Tooth:
    """One period of the saw-tooth: the wall's drag `drag_m` at which it slips, and the times of rise and fall."""

    drag_m: float
    rise_s: float
    fall_s: float

    @property
    def period_s(self) -> float:
        return self.rise_s + self.fall_s


def quasi_static_tension(wall: WallConstants, section_m2: float, stretched_length_m: float) -> Tension:
    """`T(u) = H_l(1 + u/L_s) s`: the wall as paper A's own Eq. 1, 3 and 12 give it."""
    return lambda u: wall_tension(u, wall, section_m2, stretched_length_m)


def printed_force(stretch: Any) -> Any:
    """Friction while it rises, as printed, with `m = stretch^2` and `J = 0.75 m^3 + 0.25 m - 1`:

    `F = 264.1 (m - 1) exp(0.84 (m - 1)^2) - 192.2/m^2 + 1339 m^2 (3 m^2 - 1) J exp(12.01 J^2) + 215.5` mN.

    `stretch` dimensionless, any shape; returned in N, same shape. Eq. 1 and 3 of the same paper divide by powers of the
    stretch where the third term and J multiply, and Table 1 has 12.1 for 12.01. Source: paper A Eq. 18, 20.
    """
    c = load_set("zhang2016_printed_curve")
    m = stretch**2
    J = 0.75 * m**3 + 0.25 * m - 1
    muscle = c["muscle_N"] * (m - 1) * np.exp(c["muscle_exponent"] * (m - 1) ** 2)
    collagen = c["collagen_N"] * m**2 * (3 * m**2 - 1) * J * np.exp(c["collagen_exponent"] * J**2)
    return muscle - c["matrix_N"] / m**2 + collagen + c["offset_N"]


def printed_tension(stretched_length_m: float) -> Tension:
    """Tension of the printed curve, `T(u) = F(1 + u/L_s) - F(1)` in N with `F` of `printed_force`, stretched length L_s
    in m.

    The printed rates 0.01887 and 0.04151 per second are `v_c/L_s` and `(v_c + v_i)/L_s` with L_s = L + R = 26.5 mm.
    """
    return lambda u: printed_force(1 + u / stretched_length_m) - printed_force(1.0)


def where_it_reaches(rising: Tension, value: float, end: float, tolerance: float) -> float:
    """Argument at which a `rising` law from 0 has the `value`; the search starts below `end`."""
    while rising(end) < value:
        end *= 1.5
    return float(scipy.optimize.brentq(lambda at: float(rising(at)) - value, 0.0, end, xtol=tolerance))


def stick_slip_tooth(tension: Tension, amplitude_N: float, capsule_speed: float, recoil_speed: float) -> Tooth:
    """Rise `u_c/v_c` and fall `u_c/(v_c + v_i)` where `T(u_c) = f_c`, the amplitude (paper A Eq. 11, 12, 14, 16).

    Speeds in m/s, the capsule's `v_c` and the wall's average recoil `v_i`; `ValueError` unless all three numbers are
    positive.
    """
    for name, value in (("amplitude_N", amplitude_N), ("capsule_speed", capsule_speed), ("recoil_speed", recoil_speed)):
        if not value > 0:
            raise ValueError(f"{name} must be positive; got {value:g}")
    drag = where_it_reaches(tension, amplitude_N, 1e-4, 1e-15)
    return Tooth(drag, drag / capsule_speed, drag / (capsule_speed + recoil_speed))


def friction_curve(time: Any, tension: Tension, tooth: Tooth, initial_N: float) -> Any:
    """Friction in N at `time` in s (any shape): `F_initial + T(v_c t)` rising, `F_critical - T((v_c + v_i) t)` falling.

    `F_critical = F_initial + T(u_c)`; period `tooth.period_s`. Eq. 19 prints the fall without its constant and would
    start at 192.2 mN; the constant is restored here. Source: paper A Eq. 13, 15, 16 without the mucus drag, Fig. 4, 7.
    """
    phase = time - tooth.period_s * np.floor(time / tooth.period_s)
    rising = initial_N + tension(tooth.drag_m * np.minimum(phase / tooth.rise_s, 1.0))
    falling = (
        initial_N + tension(tooth.drag_m) - tension(tooth.drag_m * np.maximum(phase - tooth.rise_s, 0.0) / tooth.fall_s)
    )
    return np.where(phase < tooth.rise_s, rising, falling)


def elastic_pressure(diameter_m: Any, capsule: Capsule, tissue: Tissue, wall: WallConstants) -> Any:
    """`P = 2 d H_c(D/D0)/D` in Pa for a wall around the diameter `D` in m, any shape (paper A Eq. 7, 9)."""
    stress = circumferential_stress(diameter_m / relaxed_diameter(capsule, tissue), wall)
    return 2 * tissue.wall_thickness_m * stress / diameter_m


def _nose_load(capsule: Capsule, tissue: Tissue, wall: WallConstants) -> float:
    def density(x: Any, _speed: Any) -> Any:
        return (
            2 * math.pi * capsule.radius_m * elastic_pressure(wall_diameter(x, capsule, tissue), capsule, tissue, wall)
        )

    return float(integrate_along(density, 0.0, 0.0, shoulder_position(capsule, tissue)))


def initial_resistance(capsule: Capsule, tissue: Tissue, wall: WallConstants) -> float:
    """`F_initial = F_e = sin(alpha) int_0^{R sin(alpha)} 2 pi R P dx` in N, independent of speed (paper A Eq. 6, 10).

    With the printed parameters (alpha 30 deg) this is 502.7 mN where the paper states 23.23 mN.
    """
    return math.sin(tissue.alpha) * _nose_load(capsule, tissue, wall)


def elastic_coulomb_limit(capsule: Capsule, tissue: Tissue, wall: WallConstants) -> float:
    """`f_c = mu [cos(alpha) int_0^{R sin(alpha)} 2 pi R P dx + 2 pi R L P_m]` in N, without weight (paper A Eq. 8, 9).

    `P_m` is the pressure on the cylinder, `D = 2 R`. With the printed parameters 148.8 mN where the paper states
    39.79 - 23.23 = 16.56 mN.
    """
    R = capsule.radius_m
    cylinder = 2 * math.pi * R * capsule.cylinder_length_m * elastic_pressure(2 * R, capsule, tissue, wall)
    return float(tissue.friction_coefficient * (math.cos(tissue.alpha) * _nose_load(capsule, tissue, wall) + cylinder))
