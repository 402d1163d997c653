"""A force wave that travels along the lumen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class PeristalticWave(Effect):
    """Force `A sin(2 pi f (t - x/c) + phi)` along +x."""

    id = "peristaltic_wave"
    summary = "a force wave that travels along the lumen"
    source = "Kerlin and Phillips 1982: 8.6 to 12.5 a minute; gut 35:625: 59 to 93 mN"
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
            ),
            "wave_speed_m_s": (0.008, 0.02),
            "phase_rad": (0.0, 1.5707963),
        }
    )
    probe = 0.003
    look_alikes = ("respiration", "fold_periodic")
    separated_by = "a record at rest at two places"

    force_N: Parameter = Parameter(
        "force_N", 0.0, "N", -0.2, 0.2, "Kerlin and Phillips 1982: 8.6 to 12.5 a minute; gut 35:625: 59 to 93 mN", fit=True
    )
    frequency_Hz: Parameter = Parameter(
        "frequency_Hz", 0.18, "Hz", 0.03, 0.6, "Kerlin and Phillips 1982: 8.6 to 12.5 a minute; gut 35:625: 59 to 93 mN", fit=True
    )
    wave_speed_m_s: Parameter = Parameter(
        "wave_speed_m_s",
        0.01,
        "m/s",
        -0.05,
        0.1,
        "Kerlin and Phillips 1982: 8.6 to 12.5 a minute; gut 35:625: 59 to 93 mN",
        fit=True,
    )
    phase_rad: Parameter = Parameter(
        "phase_rad", 0.0, "rad", -7.0, 7.0, "Kerlin and Phillips 1982: 8.6 to 12.5 a minute; gut 35:625: 59 to 93 mN", fit=True
    )

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        turn = 2 * math.pi * p["frequency_Hz"] * (s.t - s.x / p["wave_speed_m_s"])
        return p["force_N"] * np.sin(turn + p["phase_rad"])
