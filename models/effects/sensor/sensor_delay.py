"""The measurement is late."""

from models.effects.effect import Effect, Value, Values, number


class SensorDelay(Effect):
    """Output `y(t - d)`."""

    id = "sensor_delay"
    words = "a delayed sensor"
    summary = "the measurement is late"
    source = "tracing catalogue 25"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "axis"})
    probe = 0.005
    confounders = ("sensor_lowpass", "actuator_lag")
    separated_by = "a time-stamped edge; the phase is linear in frequency"

    delay_s = number(0.0, "s", 0.0, 0.5)

    def delay(self, p: Values) -> Value:
        return p["delay_s"]
