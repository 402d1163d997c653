"""Drifts with clock time: what a drying tissue and a fading grip have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Values
from models.parameter import Parameter

_FORM = "drifts of a bench settle within minutes"


@dataclass(frozen=True)
class DriftInTime(Effect):
    """Factor `1 + b s + c s^2` of the time `s = t/(1 + t/t_s)`, which runs slower and slower; never below 0.05."""

    probe = 0.001

    rate_per_s: Parameter = Parameter("rate_per_s", 0.0, "1/s", -0.08, 0.08, _FORM, fit=True)
    bend_per_s2: Parameter = Parameter("bend_per_s2", 0.0, "1/s^2", -3e-3, 3e-3, _FORM, fit=True)
    settling_s: Parameter = Parameter("settling_s", 100.0, "s", 10.0, 1000.0, _FORM, fit=True, spread=100.0)

    def factor(self, t: Any, p: Values) -> Any:
        """The factor at the time `t` in s since the record began."""
        s = settling_time(t, p)
        return np.maximum(1 + (p["rate_per_s"] + p["bend_per_s2"] * s) * s, 0.05)


def settling_time(t: Any, p: Values) -> Any:
    """The time s in s that runs slower and slower, up to `settling_s`."""
    return t / (1 + t / p["settling_s"])
