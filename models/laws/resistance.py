"""Force over speed of a steadily sliding capsule: resistance of the wall, mucus drag, Coulomb part (paper V Eq. 1,
7-12).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from models.laws.five_elements import blend_weight, high_speed_moduli, hoop_stress, low_speed_moduli
from models.laws.geometry import GRAVITY, Capsule, Tissue, relaxed_diameter, shoulder_position, wall_diameter
from models.parameter import load_set

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_MM = 1e3  # the mucus's empirical equation counts in mm and mm/s
_SLOWEST = 1e-9  # m/s; below it the law has its limit of rest, where only E3 is left


def contact_pressure(distance_m: Any, speed: Any, capsule: Capsule, tissue: Tissue) -> Any:
    """`P(x) = 2 l_m tau(x)/D(x)` in Pa, `tau` the hoop stress at strain `e = (D - D0)/D0` (paper V Eq. 6, 7).

    `distance_m` x from the first contact in m and `speed` in m/s, shapes that broadcast; even in speed. The tissue's
    `regime` takes the low-speed or the high-speed moduli or blends the two stresses about 20 mm/s.
    """
    D = wall_diameter(distance_m, capsule, tissue)
    D0 = relaxed_diameter(capsule, tissue)
    e = (D - D0) / D0
    v = np.maximum(np.abs(speed), _SLOWEST)
    sets = {"low": low_speed_moduli(e), "high": high_speed_moduli()}
    if tissue.regime == "blend":
        low, high = (hoop_stress(e, distance_m, v, moduli) for moduli in sets.values())
        share = blend_weight(v)
        stress = (1 - share) * low + share * high
    else:
        stress = hoop_stress(e, distance_m, v, sets[tissue.regime])
    return 2 * tissue.wall_thickness_m * stress / D


def integrate_along(density: Callable[[Any, Any], Any], speed: Any, start_m: float, end_m: float) -> Any:
    """`int density(x, speed) dx` over `start`..`end` by Gauss quadrature with 64 nodes, in the density's unit times m.

    `speed` is a number, an array of any shape (all nodes at once) or a CasADi symbol; the result has its shape.
    """
    x = 0.5 * (end_m - start_m) * (_NODES + 1) + start_m
    w = 0.5 * (end_m - start_m) * _WEIGHTS
    if isinstance(speed, ca.SX | ca.MX | ca.DM):
        return sum(weight * density(node, speed) for node, weight in zip(x.tolist(), w.tolist(), strict=True))
    return np.asarray(density(x, np.asarray(speed, dtype=float)[..., None]) @ w)


def pressure_integrals(speed: Any, capsule: Capsule, tissue: Tissue) -> tuple[Any, Any]:
    """`I1` (nose) and `I2` (cylinder) of `2 pi R P dx` in N at `speed` in m/s, any shape, number or CasADi symbol.

    The nose runs over 0..x_s, x_s = R sin(alpha), the cylinder over x_s..x_s + L. The quadrature's relative error is
    below 1e-6 at any speed of the low-speed moduli, below 1e-9 from 0.5 mm/s on. Source: paper V Eq. 7, 8, 12.
    """
    circumference = 2 * math.pi * capsule.radius_m

    def density(x: Any, v: Any) -> Any:
        return circumference * contact_pressure(x, v, capsule, tissue)

    shoulder = shoulder_position(capsule, tissue)
    nose = integrate_along(density, speed, 0.0, shoulder)
    return nose, integrate_along(density, speed, shoulder, shoulder + capsule.cylinder_length_m)


def environmental_resistance(speed: Any, capsule: Capsule, tissue: Tissue) -> Any:
    """`F_e(v) = sin(theta) I1` in N: the stretched wall's resistance to the nose; `speed` v in m/s (paper V Eq. 8)."""
    return math.sin(tissue.theta) * pressure_integrals(speed, capsule, tissue)[0]


def normal_load(speed: Any, capsule: Capsule, tissue: Tissue) -> Any:
    """`N(v) = m g + cos(theta) I1 + I2` in N: load by weight, nose and cylinder; `speed` v in m/s (paper V Eq. 12)."""
    nose, cylinder = pressure_integrals(speed, capsule, tissue)
    return capsule.mass_kg * GRAVITY + math.cos(tissue.theta) * nose + cylinder


def mucus_drag(slip_speed: Any, film_m: float) -> Any:
    """`F_v = delta(w) w`, `delta = 0.1148 + 11.24 (w/h)^-0.7552` in N s/m with w in mm/s and film h in mm, of the
    shear-thinning film between capsule and wall; odd in w, 0 at rest.

    `slip_speed` w in m/s, any shape, `film_m` h in m; the drag is in N, same shape. Only this reading of the garbled
    Eq. 10 gives the 0.73 mN at 0.5 mm/s that paper A quotes (0.74 mN). Source: paper V Eq. 9, 10, after Wu 2000.
    """
    s = load_set("wu2000_mucus")
    w, h = np.abs(slip_speed) * _MM, film_m * _MM
    drag = s["floor_N_s_per_m"] * w + s["scale_N_s_per_m"] * h * (w / h) ** (1 + s["exponent"])
    return np.sign(slip_speed) * drag / _MM


@dataclass(frozen=True)
class Resistance:
    """The three parts of the force on a sliding capsule in N: numbers, arrays over speed or CasADi expressions."""

    environmental: Any
    viscous: Any
    coulomb: Any

    @property
    def total(self) -> Any:
        """`F = F_e + F_v + F_c` in N."""
        return self.environmental + self.viscous + self.coulomb


def sliding_resistance(speed: Any, capsule: Capsule, tissue: Tissue) -> Resistance:
    """`F(v) = F_e(v) + F_v(v) + F_c(v)`, `F_c = mu N`, `F_v` the mucus drag, at `speed` v > 0 in m/s, any shape.

    At 10 mm/s the paper's 50.1 g capsule gives 66.37 + 2.55 + 78.78 = 147.7 mN. The tissue's `regime` "blend" passes
    smoothly from the low-speed to the high-speed moduli about 20 mm/s, where the paper's Fig. 7 jumps. Source: paper V
    Eq. 1, 8, 9, 11, 12.
    """
    return Resistance(
        environmental_resistance(speed, capsule, tissue),
        mucus_drag(speed, tissue.mucus_thickness_m),
        tissue.friction_coefficient * normal_load(speed, capsule, tissue),
    )
