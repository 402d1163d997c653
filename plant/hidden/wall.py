"""Hidden effects on the wall that the capsule drags along: its tension and the speed at which it draws back."""

import math

from plant.compiling import compiled
from plant.hidden.registry import ROW
from plant.tables import Floats


@compiled
def stiffening(u: float, h: Floats) -> float:
    """Factor on T(u): `1 + a/(1 + (|u|/u_0)^1.2)`."""
    if h[ROW.small_strain_stiffening, 0] == 0.0:
        return 1.0
    return float(1 + h[ROW.small_strain_stiffening, 0] / (1 + (abs(u) / h[ROW.small_strain_stiffening, 1]) ** 1.2))


@compiled
def rate_tension(rate: float, h: Floats) -> float:
    """Tension in N that the stretch rate `u'` in m/s adds: `a sgn(u') (|u'|/10 mm/s)^0.9`."""
    if h[ROW.wall_viscosity, 0] == 0.0 or rate == 0.0:
        return 0.0
    return float(math.copysign(h[ROW.wall_viscosity, 0] * (abs(rate) * 100.0) ** 0.9, rate))


@compiled
def recovery_speed(u: float, u_c: float, t_r: float, h: Floats) -> float:
    """Speed in m/s at which a slipping wall draws back: `u_c/t_r`, or the hidden exponential one."""
    if h[ROW.exponential_recovery, 0] == 0.0:
        return u_c / t_r
    return float(h[ROW.exponential_recovery, 0] * u_c * (0.15 + (abs(u) / u_c) ** 0.8) / t_r)
