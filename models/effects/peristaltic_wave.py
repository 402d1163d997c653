"""A force wave that travels along the lumen."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from models.effects.effect import Values
from models.effects.force_in_time import ForceInTime, frequencies
from models.parameter import Parameter

_SOURCE = "Kerlin and Phillips 1982: 8.6 to 12.5 a minute; gut 35:625: 59 to 93 mN"


@dataclass(frozen=True)
class PeristalticWave(ForceInTime):
    """Force `A sin(2 pi f (t - x/c) + phi)` along +x."""

    id = "peristaltic_wave"
    summary = "a force wave that travels along the lumen"
    source = _SOURCE
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = MappingProxyType({"frequency_Hz": frequencies(0.04, 0.41), "wave_speed_m_s": (0.008, 0.02)})
    look_alikes = ("respiration", "fold_periodic")
    separated_by = "a record at rest at two places"

    frequency_Hz: Parameter = Parameter("frequency_Hz", 0.18, "Hz", 0.03, 0.6, _SOURCE, fit=True)
    wave_speed_m_s: Parameter = Parameter("wave_speed_m_s", 0.01, "m/s", -0.05, 0.1, _SOURCE, fit=True)

    def delay_at(self, x: Any, p: Values) -> Any:
        return x / p["wave_speed_m_s"]
