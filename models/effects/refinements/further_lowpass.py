"""A second smoothing after the first: what a named one leaves of its own order. Never named itself."""

from models.effects.effect import number
from models.effects.sensor.sensor_lowpass import SensorLowpass


class FurtherLowpass(SensorLowpass):
    """`tau_2 y'' + y' = x'` of the reading `x'` that the first low-pass lets through."""

    id = "further_lowpass"
    words = "a second low-pass of the sensor"
    summary = "a second smoothing of the measurement"
    source = "an amplifier's filter before a digital one: smoothing is of second order or more"
    confounders = ("sensor_lowpass", "sensor_delay")
    refined_by = ()

    time_s = number(0.0, "s", 0.0, 0.3)
