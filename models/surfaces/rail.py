"""What an axis moves on: bearings with Coulomb and viscous friction."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.formula import Formula, Line, equal, symbols
from models.parameter import Parameter
from models.surfaces.surface import FULL, Held, Levels, Surface, Values

_MOST = 1e9


@dataclass(frozen=True)
class Rail(Surface):
    """`M a = F_act - (F_v |v| + F_c) Sgn(v) - offset` of an axis along a line or about itself, with the `names` and
    `units` of inertia, viscous and Coulomb friction and offset: it rests while the other forces stay within friction.
    """

    names: tuple[str, str, str, str]
    units: tuple[str, str, str, str]

    @property
    def body_kg(self) -> float:
        return 0.0  # the inertia is fitted: it comes with the drive's force

    def parameters(self) -> tuple[Parameter, ...]:
        ends = ((1.0, 1e-9, _MOST), (0.0, 0.0, _MOST), (0.0, 0.0, _MOST), (0.0, -_MOST, _MOST))
        rows = zip(self.names, self.units, ends, strict=True)
        return tuple(Parameter(name, at, unit, low, high, "rig file", fit=True) for name, unit, (at, low, high) in rows)

    def hold(self, speed: Any, p: Values, carried_kg: float = 0.0, levels: Levels = FULL, pressing: Any = 0.0) -> Held:
        _, viscous, coulomb, _ = (p[name] for name in self.names)
        return (coulomb + viscous * speed) * levels[0], 0.0

    def equations(self, p: Values) -> list[Line]:
        a, v, force = symbols("a v F_act")
        inertia, viscous, coulomb, offset = (Formula.of(p[name]) for name in self.names)
        return [[equal(inertia * a, force - viscous * v - coulomb * np.sign(v) - offset)]]


LINE = Rail(
    ("mass_kg", "viscous_friction_N_s_per_m", "coulomb_friction_N", "offset_N"),
    ("kg", "N s/m", "N", "N"),
)
TURN = Rail(
    ("inertia_kg_m2", "viscous_friction_N_m_s_per_rad", "coulomb_friction_N_m", "offset_N_m"),
    ("kg m2", "N m s/rad", "N m", "N m"),
)
