"""Saturation of the drive."""

from models.effects.effect import Effect, Signals, Value, Values, number


class ActuatorSaturation(Effect):
    """Gain `1/(1 + a u^2)`, cubic loss at small drive."""

    id = "actuator_saturation"
    words = "a saturating drive"
    summary = "saturation of the drive"
    source = "tracing catalogue 19"
    kinds = frozenset({"coil"})
    probe = 0.5
    confounders = ("actuator_dead_zone",)
    separated_by = "amplitude staircase"

    inverse_square = number(0.0, "1/command^2", 0.0, 100.0)

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 / (1 + p["inverse_square"] * s.command**2)
