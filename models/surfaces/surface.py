"""What a surface is: how it supports the body and what a fit may change; the rigid plate, and the air."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

from models.formula import Line, called, equal, symbols
from models.laws.geometry import GRAVITY
from models.parameter import Parameter

Values = Mapping[str, Any]
Levels = tuple[Any, Any, Any]
Held = tuple[Any, Any]
FULL: Final[Levels] = (1.0, 1.0, 1.0)  # factors on elastic resistance, weight and load where nothing changes them


class Surface(ABC):
    """What the body lies on. `dragged`: a wall sticks to the body, is dragged along and draws back, with the states u
    and slip; else there is friction alone.
    """

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
