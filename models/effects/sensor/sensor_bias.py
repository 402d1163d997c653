"""The sensor's zero is off."""

from models.effects.effect import Effect, Signals, Value, Values, number


class SensorBias(Effect):
    """Output `y + b`."""

    id = "sensor_bias"
    words = "an offset of the sensor"
    summary = "the sensor's zero is off"
    source = "tracing catalogue 24"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.001
    confounders = ("incline_gravity", "directional_asymmetry")
    separated_by = "a reading without load"

    bias = number(0.0, "of the measured unit", -0.5, 0.5)

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return y + p["bias"]
