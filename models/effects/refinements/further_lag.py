"""A second lag of the drive after the first: what a named lag leaves of its own order. Never named itself."""

from models.effects.drive.actuator_lag import ActuatorLag
from models.effects.effect import by_name, number


class FurtherLag(ActuatorLag):
    """`tau_2 c'' = c' - c''` of the command `c'` that the first lag lets through."""

    id = "further_lag"
    words = "a second lag of the drive"
    summary = "a second lag of the drive"
    source = "a current loop under a position loop: drives are of second order or more"
    grid = by_name(time_s=(0.03,))
    confounders = ("actuator_lag", "sensor_delay")
    refined_by = ()

    time_s = number(0.0, "s", 0.0, 0.5)
