"""What a surface is: how it supports the body and what a fit may change; the rigid plate, the air, an axis' rail."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from models.formula import Formula, Line, called, equal, symbols
from models.laws.geometry import GRAVITY
from models.parameter import Parameter

Values = Mapping[str, Any]
Levels = tuple[Any, Any, Any]
Held = tuple[Any, Any]
FULL: Final[Levels] = (1.0, 1.0, 1.0)  # factors on elastic resistance, weight and load where nothing changes them


class Surface(ABC):
    """What the body lies on. `dragged`: a wall sticks to it, with the states u and slip; else friction alone."""

    dragged: ClassVar[bool] = False

    @property
    @abstractmethod
    def body_kg(self) -> float:
        """Mass of the body on it, without what the body carries."""

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that calibration fits; the first one scales the friction."""

    @abstractmethod
    def hold(self, speed: Any, p: Values, carried_kg: float = 0.0, levels: Levels = FULL, pressing: Any = 0.0) -> Held:
        """Coulomb friction in N and the limit in N at which a dragged wall slips (else 0), at `speed` >= 0 in m/s and
        the parameters `p`. `levels` are effects' factors on the friction, on the weight's part of the limit and on the
        rest of it; `pressing` in N is the load beside the weights.
        """

    @abstractmethod
    def equations(self, p: Values) -> list[Line]:
        """The body's equation of motion, a line each."""

    def tension(self, u: Any) -> Any:
        """Tension in N of a wall dragged by `u` in m."""
        return 0.0

    def stiffness(self) -> float:
        """Slope of the tension in N/m at u = 0."""
        return 0.0

    def drag_at(self, tension: Any) -> Any:
        """Drag in m at which the wall has the `tension` >= 0 in N."""
        return 0.0

    def mucus(self, w: Any) -> Any:
        """Drag in N of the film between body and wall at the relative speed `w` in m/s."""
        return 0.0

    @property
    def recovery_time_s(self) -> float:
        """Time in s in which a wall that slipped draws back."""
        return 1.0


@dataclass(frozen=True)
class Plate(Surface):
    """A body of `mass_kg` (without an inner mass) on a plate: it rests while the other forces stay within `mu m g`."""

    mass_kg: float
    friction_coefficient: float = 0.29

    @property
    def body_kg(self) -> float:
        return self.mass_kg

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter.near("friction_coefficient", self.friction_coefficient, "1", 0.5, 2.0, "rig file"),)

    def hold(self, speed: Any, p: Values, carried_kg: float = 0.0, levels: Levels = FULL, pressing: Any = 0.0) -> Held:
        load = carried_kg * GRAVITY + pressing
        return p["friction_coefficient"] * (self.mass_kg * GRAVITY + load) * levels[0], 0.0

    def equations(self, p: Values) -> list[Line]:
        m, a, F_act, N, v = symbols("m a F_act N v")
        friction = p["friction_coefficient"] * N * called("Sgn", v)
        return [[equal(m * a, F_act - friction), ", ", N, " the load on the plate"]]


@dataclass(frozen=True)
class Air(Surface):
    """A body of `mass_kg` (without an inner mass) that nothing holds: `m a = F_act`."""

    mass_kg: float

    @property
    def body_kg(self) -> float:
        return self.mass_kg

    def parameters(self) -> tuple[Parameter, ...]:
        return ()

    def hold(self, speed: Any, p: Values, carried_kg: float = 0.0, levels: Levels = FULL, pressing: Any = 0.0) -> Held:
        return 0.0, 0.0

    def equations(self, p: Values) -> list[Line]:
        m, a, F_act = symbols("m a F_act")
        return [[equal(m * a, F_act)]]


_MOST = 1e9


@dataclass(frozen=True)
class Rail(Surface):
    """`M a = F_act - (F_v |v| + F_c) Sgn(v) - offset` of an axis along a line or about itself, with the `names` and
    `units` of inertia, viscous and Coulomb friction and offset: it rests while the other forces stay within friction.
    The first two levels are factors on its dry and on its viscous friction.
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
        return coulomb * levels[0] + viscous * speed * levels[1], 0.0

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
