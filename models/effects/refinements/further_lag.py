"""A second lag of the drive in a row with the first: what a named lag leaves of its own order. Refines an effect, never
named itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from models.effects.drive.actuator_lag import ActuatorLag
from models.parameter import Parameter

_SOURCE = "a current loop under a position loop: drives are of second order or more"


@dataclass(frozen=True)
class FurtherLag(ActuatorLag):
    """`tau_2 c'' = c' - c''` of the command `c'` that the first lag lets through."""

    id = "further_lag"
    summary = "a second lag of the drive"
    source = _SOURCE
    grid = MappingProxyType({"time_s": (0.03,)})
    confounders = ("actuator_lag", "sensor_delay")
    refined_by = ()

    time_s: Parameter = Parameter("time_s", 0.0, "s", 0.0, 0.5, _SOURCE, fit=True)
