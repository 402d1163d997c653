"""50/60 Hz on the signal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class MainsHum(Effect):
    """Output `y + A sin(2 pi f t + phi)`."""

    id = "mains_hum"
    summary = "mains frequency on the signal"
    source = "paper C Section 2.3 (power frequency interference)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = MappingProxyType({"frequency_Hz": (50.0, 60.0), "phase_rad": (0.0, 1.5707963)})
    probe = 0.0001
    needs = ("samples",)
    confounders = ("respiration",)
    separated_by = "a record with the drive off"

    hum: Parameter = Parameter(
        "hum", 0.0, "of the measured unit", -0.05, 0.05, "paper C Section 2.3 (power frequency interference)", fit=True
    )
    frequency_Hz: Parameter = Parameter(
        "frequency_Hz", 50.0, "Hz", 49.0, 61.0, "paper C Section 2.3 (power frequency interference)", fit=True
    )
    phase_rad: Parameter = Parameter(
        "phase_rad", 0.0, "rad", -7.0, 7.0, "paper C Section 2.3 (power frequency interference)", fit=True, role="phase"
    )

    def measured(self, s: Signals, p: Values, z: Values, y: Any) -> Any:
        return y + p["hum"] * np.sin(2 * math.pi * p["frequency_Hz"] * s.t + p["phase_rad"])
