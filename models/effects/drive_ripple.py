"""A force periodic in the drive's position: cogging of the motor, ripple of the ball screw."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SOURCE = "motor cogging and ball-screw ripple; EMPS train record, 2.50 mm, 1.0 N"
_WAVELENGTHS = tuple(float(1 / k) for k in np.arange(50.0, 668.0, 2.0))


@dataclass(frozen=True)
class DriveRipple(Effect):
    """Force `A sin(2 pi x/L + phi)` along +x, the same sign going and coming back, unlike `fold_periodic`.

    The wavelengths tried lie 2 per m apart in 1/L, which does for strokes up to 0.25 m.
    """

    id = "drive_ripple"
    summary = "a force periodic in the drive's position, the same sign going and coming back"
    source = _SOURCE
    kinds = frozenset({"axis"})
    grid = MappingProxyType({"wavelength_m": _WAVELENGTHS, "phase_rad": (0.0, math.pi / 2)})
    probe = 0.5
    look_alikes = ("fold_periodic",)
    separated_by = "reverse over the same place"

    amplitude_N: Parameter = Parameter("amplitude_N", 0.0, "N", -50.0, 50.0, _SOURCE, fit=True)
    wavelength_m: Parameter = Parameter("wavelength_m", 0.005, "m", 0.001, 0.05, _SOURCE, fit=True)
    phase_rad: Parameter = Parameter("phase_rad", 0.0, "rad", -7.0, 7.0, _SOURCE, fit=True)

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        return p["amplitude_N"] * np.sin(2 * math.pi * s.x / p["wavelength_m"] + p["phase_rad"])
