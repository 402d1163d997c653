"""What holds no wall: a rigid plate under the body with Coulomb friction, and the air with nothing."""

from dataclasses import dataclass
from typing import Any

from models.laws.geometry import GRAVITY
from models.parameter import Parameter
from models.surfaces.surface import FULL, Held, Levels, Surface, Values


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

    def equations(self, p: Values) -> list[str]:
        return [f"m a = F_act - {p['friction_coefficient']:.4g} N Sgn(v), N the load on the plate"]


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
