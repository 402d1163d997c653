"""Friction and force as functions of clock time: drifts (a drying tissue, a fading grip) and periodic forces
(breathing, waves).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SETTLES = "drifts of a bench settle within minutes"


@dataclass(frozen=True)
class DriftInTime(Effect):
    """Factor `1 + b s + c s^2` of the time `s = t/(1 + t/t_s)`, which runs slower and slower; never below 0.05."""

    probe = 0.001

    rate_per_s: Parameter = Parameter("rate_per_s", 0.0, "1/s", -0.08, 0.08, _SETTLES, fit=True)
    bend_per_s2: Parameter = Parameter("bend_per_s2", 0.0, "1/s^2", -3e-3, 3e-3, _SETTLES, fit=True)
    settling_s: Parameter = Parameter("settling_s", 100.0, "s", 10.0, 1000.0, _SETTLES, fit=True, spread=100.0)


def drift(t: Any, p: Values) -> Any:
    """The factor of a `DriftInTime` at the time `t` in s since the record began."""
    s = settling_time(t, p)
    return np.maximum(1 + (p["rate_per_s"] + p["bend_per_s2"] * s) * s, 0.05)


def settling_time(t: Any, p: Values) -> Any:
    """The time s in s that runs slower and slower, up to `settling_s`."""
    return t / (1 + t / p["settling_s"])


_FORM = "contractions are pulses rather than sines"
# of neighbouring frequencies to screen: over half a minute their phases part by less than half a turn up to 0.4 Hz
RATIO = 1.09


def frequencies(lowest_Hz: float, highest_Hz: float, ratio: float = RATIO) -> tuple[float, ...]:
    """Frequencies in Hz in steps of `ratio` from `lowest_Hz` up to `highest_Hz`, the last one within both."""
    count = math.floor(math.log(highest_Hz / lowest_Hz) / math.log(ratio) + 1e-9) + 1
    return tuple(lowest_Hz * ratio**k for k in range(count))


def with_harmonics(wave: Any, turn: Any, p: Values, first: int, names: tuple[str, ...]) -> Any:
    """`wave` and the harmonics of the angle `turn` in rad, from order `first` on, whose sizes are `NAME_sin` and
    `NAME_cos` of `names`.
    """
    for k, name in enumerate(names, start=first):
        wave = wave + p[f"{name}_sin"] * np.sin(k * turn) + p[f"{name}_cos"] * np.cos(k * turn)
    return wave


@dataclass(frozen=True)
class ForceInTime(Effect):
    """Force `A (sin q + o + sum of harmonics 2 to 4)` along +x, `q = 2 pi (f t - n) + phi`, `n` the turns by which it
    is late at the capsule's place.

    A wave of pulses, `max(0, sin q)`, has A = 0.5, o = 0.64, and -0.42 cos 2q and -0.08 cos 4q as its harmonics.
    """

    probe = 0.003

    force_N: Parameter = Parameter(
        "force_N", 0.0, "N", -0.2, 0.2, "gut 35:625: 59 to 93 mN, twice that at most", fit=True
    )
    frequency_Hz: Parameter = Parameter(
        "frequency_Hz", 0.25, "Hz", 0.03, 1.5, "tracing catalogue 15: 0.2 to 0.3 Hz", fit=True
    )
    phase_rad: Parameter = Parameter(
        "phase_rad", 0.0, "rad", -7.0, 7.0, "any: where in its cycle a record begins", fit=True, role="phase"
    )
    second_sin: Parameter = Parameter("second_sin", 0.0, "1", -1.0, 1.0, _FORM, fit=True)
    second_cos: Parameter = Parameter("second_cos", 0.0, "1", -1.0, 1.0, _FORM, fit=True)
    third_sin: Parameter = Parameter("third_sin", 0.0, "1", -0.7, 0.7, _FORM, fit=True, spread=0.2)
    third_cos: Parameter = Parameter("third_cos", 0.0, "1", -0.7, 0.7, _FORM, fit=True, spread=0.2)
    fourth_sin: Parameter = Parameter("fourth_sin", 0.0, "1", -0.5, 0.5, _FORM, fit=True, spread=0.2)
    fourth_cos: Parameter = Parameter("fourth_cos", 0.0, "1", -0.5, 0.5, _FORM, fit=True, spread=0.2)
    offset: Parameter = Parameter("offset", 0.0, "1", -1.5, 1.5, _FORM, fit=True)

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        return contraction(turn(s, p), p)


def turn(s: Signals, p: Values, late: Any = 0.0) -> Any:
    """The angle q in rad of a `ForceInTime` that is `late` by so many turns."""
    return 2 * math.pi * (p["frequency_Hz"] * s.t - late) + p["phase_rad"]


def contraction(turn: Any, p: Values) -> Any:
    """The force of a `ForceInTime` at its angle `turn` in rad."""
    return p["force_N"] * with_harmonics(np.sin(turn) + p["offset"], turn, p, 2, ("second", "third", "fourth"))
