"""A force periodic in time, the same everywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class Respiration(Effect):
    """Force `A sin(2 pi f t + phi)` along +x."""

    id = "respiration"
    summary = "a force periodic in time, the same everywhere"
    source = "tracing catalogue 15: 0.2 to 0.3 Hz"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = MappingProxyType(
        {
            "frequency_Hz": (
                0.04,
                0.0436,
                0.04752,
                0.0518,
                0.05646,
                0.06154,
                0.06708,
                0.07312,
                0.0797,
                0.08688,
                0.09469,
                0.10322,
                0.11251,
                0.12263,
                0.13367,
                0.1457,
                0.15881,
                0.17311,
                0.18868,
                0.20567,
                0.22418,
                0.24435,
                0.26634,
                0.29031,
                0.31644,
                0.34492,
                0.37597,
                0.4098,
                0.44669,
                0.48689,
                0.53071,
                0.57847,
                0.63053,
                0.68728,
                0.74914,
                0.81656,
            ),
            "phase_rad": (0.0, 1.5707963),
        }
    )
    probe = 0.003
    look_alikes = ("peristaltic_wave", "mains_hum")
    separated_by = "a second position; a pause of the ventilator"

    force_N: Parameter = Parameter("force_N", 0.0, "N", -0.2, 0.2, "tracing catalogue 15: 0.2 to 0.3 Hz", fit=True)
    frequency_Hz: Parameter = Parameter("frequency_Hz", 0.25, "Hz", 0.03, 1.5, "tracing catalogue 15: 0.2 to 0.3 Hz", fit=True)
    phase_rad: Parameter = Parameter("phase_rad", 0.0, "rad", -7.0, 7.0, "tracing catalogue 15: 0.2 to 0.3 Hz", fit=True)

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        return p["force_N"] * np.sin(2 * math.pi * p["frequency_Hz"] * s.t + p["phase_rad"])
