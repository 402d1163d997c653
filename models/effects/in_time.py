"""Friction and force over clock time: drifts (drying tissue, fading grip) and periodic forces (breathing, waves)."""

import math

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number

_SETTLES = "drifts of a bench settle within minutes"


class DriftInTime(Effect):
    """Factor `1 + b s + c s^2` of the time `s = t/(1 + t/t_s)`, which runs slower and slower; never below 0.05."""

    probe = 0.001

    rate_per_s = number(0.0, "1/s", -0.08, 0.08, _SETTLES)
    bend_per_s2 = number(0.0, "1/s^2", -3e-3, 3e-3, _SETTLES)
    settling_s = number(100.0, "s", 10.0, 1000.0, _SETTLES, spread=100.0)


def drift(t: Value, p: Values) -> Value:
    """The factor of a `DriftInTime` at the time `t` in s since the record began."""
    s = settling_time(t, p)
    return np.maximum(1 + (p["rate_per_s"] + p["bend_per_s2"] * s) * s, 0.05)


def settling_time(t: Value, p: Values) -> Value:
    """The time s in s that runs slower and slower, up to `settling_s`."""
    return t / (1 + t / p["settling_s"])


_FORM = "contractions are pulses rather than sines"
# of neighbouring frequencies to screen: over half a minute their phases part by less than half a turn up to 0.4 Hz
RATIO = 1.09


def frequencies(lowest_Hz: float, highest_Hz: float, ratio: float = RATIO) -> tuple[float, ...]:
    """Frequencies in Hz in steps of `ratio` from `lowest_Hz` up to `highest_Hz`, the last one within both."""
    count = math.floor(math.log(highest_Hz / lowest_Hz) / math.log(ratio) + 1e-9) + 1
    return tuple(lowest_Hz * ratio**k for k in range(count))


def with_harmonics(wave: Value, turn: Value, p: Values, first: int, names: tuple[str, ...]) -> Value:
    """`wave` and harmonics of the angle `turn` in rad from order `first` on, sizes `NAME_sin` and `NAME_cos`."""
    for k, name in enumerate(names, start=first):
        wave = wave + p[f"{name}_sin"] * np.sin(k * turn) + p[f"{name}_cos"] * np.cos(k * turn)
    return wave


class ForceInTime(Effect):
    """Force `A (sin q + o + sum of harmonics 2 to 4)` along +x, `q = 2 pi (f t - n) + phi`, `n` the turns by which it
    is late at the capsule's place.

    A wave of pulses, `max(0, sin q)`, has A = 0.5, o = 0.64, and -0.42 cos 2q and -0.08 cos 4q as its harmonics.
    """

    probe = 0.003

    force_N = number(0.0, "N", -0.2, 0.2, "gut 35:625: 59 to 93 mN, twice that at most")
    frequency_Hz = number(0.25, "Hz", 0.03, 1.5, "tracing catalogue 15: 0.2 to 0.3 Hz")
    phase_rad = number(0.0, "rad", -7.0, 7.0, "any: where in its cycle a record begins", role="phase")
    second_sin = number(0.0, "1", -1.0, 1.0, _FORM)
    second_cos = number(0.0, "1", -1.0, 1.0, _FORM)
    third_sin = number(0.0, "1", -0.7, 0.7, _FORM, spread=0.2)
    third_cos = number(0.0, "1", -0.7, 0.7, _FORM, spread=0.2)
    fourth_sin = number(0.0, "1", -0.5, 0.5, _FORM, spread=0.2)
    fourth_cos = number(0.0, "1", -0.5, 0.5, _FORM, spread=0.2)
    offset = number(0.0, "1", -1.5, 1.5, _FORM)

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return contraction(turn(s, p), p)


def turn(s: Signals, p: Values, late: Value = 0.0) -> Value:
    """The angle q in rad of a `ForceInTime` that is `late` by so many turns."""
    return 2 * math.pi * (p["frequency_Hz"] * s.t - late) + p["phase_rad"]


def contraction(turn: Value, p: Values) -> Value:
    """The force of a `ForceInTime` at its angle `turn` in rad."""
    return p["force_N"] * with_harmonics(np.sin(turn) + p["offset"], turn, p, 2, ("second", "third", "fourth"))
