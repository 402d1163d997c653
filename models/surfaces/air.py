"""Nothing under the body: it hangs or floats, and no friction holds it."""

from dataclasses import dataclass
from typing import Any

from models.parameter import Parameter
from models.surfaces.surface import FULL, Held, Levels, Surface, Values


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

    def equations(self, p: Values) -> list[str]:
        return ["m a = F_act"]
