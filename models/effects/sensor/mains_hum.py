"""50/60 Hz on the signal."""

import math

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number


class MainsHum(Effect):
    """Output `y + A sin(2 pi f t + phi)`."""

    id = "mains_hum"
    words = "a mains hum"
    summary = "mains frequency on the signal"
    source = "paper C Section 2.3 (power frequency interference)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = by_name(frequency_Hz=(50.0, 60.0), phase_rad=(0.0, 1.5707963))
    probe = 0.0001
    needs = ("samples",)
    confounders = ("respiration",)
    separated_by = "a record with the drive off"

    hum = number(0.0, "of the measured unit", -0.05, 0.05)
    frequency_Hz = number(50.0, "Hz", 49.0, 61.0)
    phase_rad = number(0.0, "rad", -7.0, 7.0, role="phase")

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return y + p["hum"] * np.sin(2 * math.pi * p["frequency_Hz"] * s.t + p["phase_rad"])
