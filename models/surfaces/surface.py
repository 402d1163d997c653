"""What a surface is: how it holds the body that lies on it, and what a model may fit of it. One subclass a file."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from models.parameter import Parameter

Values = Mapping[str, Any]
Levels = tuple[Any, Any, Any]
Held = tuple[Any, Any]
FULL: Final[Levels] = (1.0, 1.0, 1.0)  # factors on elastic resistance, weight and load where nothing changes them


class Surface(ABC):
    """What the body lies on. `dragged`: a wall clings to the body, is dragged along and draws back, with the states u
    and slip; else friction is all there is, and the methods of a wall say nothing.
    """

    dragged: ClassVar[bool] = False

    @property
    @abstractmethod
    def body_kg(self) -> float:
        """Mass of the body on it, without what the body carries."""

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """What differs from rig to rig, for calibration to fit; the first one scales the friction."""

    @abstractmethod
    def hold(self, speed: Any, p: Values, carried_kg: float = 0.0, levels: Levels = FULL, pressing: Any = 0.0) -> Held:
        """Coulomb friction in N and the limit in N at which a dragged wall slips (0 without one), at `speed` >= 0 in
        m/s and the parameters `p`. `levels` are effects' factors on the friction, on the weight's part of the limit and
        on the rest of it; `pressing` in N is what presses the body on the surface beside the weights.
        """

    @abstractmethod
    def equations(self, p: Values) -> list[str]:
        """The body's equation of motion in words and numbers, a line each."""

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
