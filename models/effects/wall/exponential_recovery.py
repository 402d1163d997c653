"""The wall draws back exponentially instead of at constant speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class ExponentialRecovery(Effect):
    """Recovery at `v_i (1 - q + q m |u|/u_c)`: constant speed at q = 0, exponential with time constant `t_r/m` at q =
    1.
    """

    id = "exponential_recovery"
    summary = "the wall draws back exponentially"
    source = "paper A Section 3.2 (real contraction is nonlinear)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.1
    confounders = ("wall_viscosity",)
    separated_by = "the shape of the falling edge at high sampling rate"

    share: Parameter = Parameter(
        "share", 0.0, "1", -0.5, 1.5, "paper A Section 3.2 (real contraction is nonlinear)", fit=True
    )
    times: Parameter = Parameter(
        "times", 3.0, "1", 0.5, 10.0, "95 % of an exponential within t_r", fit=True, spread=1.0
    )

    def recovery(self, s: Signals, p: Values, z: Values, speed: Any, onset: Any) -> Any:
        return speed * (1 - p["share"] + p["share"] * p["times"] * np.abs(s.drag) / onset)
