"""The sensor's gain is off."""

from models.effects.effect import Effect, Signals, Value, Values, number


class SensorScale(Effect):
    """Output `(1 + e) y`."""

    id = "sensor_scale"
    words = "a gain error of the sensor"
    summary = "the sensor's gain is off"
    source = "tracing catalogue 24"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.02
    confounders = ("small_strain_stiffening",)
    separated_by = "a known load; a known distance"

    error = number(0.0, "1", -0.5, 0.5)

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return y * (1 + p["error"])
