"""The wall draws back exponentially instead of at constant speed."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number


class ExponentialRecovery(Effect):
    """Recovery at `v_i (1 - q + q m |u|/u_c)`: constant speed at q = 0, exponential in `t_r/m` at q = 1."""

    id = "exponential_recovery"
    words = "an exponential recovery of the wall"
    summary = "the wall draws back exponentially"
    source = "paper A Section 3.2 (real contraction is nonlinear)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.1
    confounders = ("wall_viscosity",)
    separated_by = "the shape of the falling edge at high sampling rate"

    share = number(0.0, "1", -0.5, 1.5)
    times = number(3.0, "1", 0.5, 10.0, "95 % of an exponential within t_r", spread=1.0)

    def recovery(self, s: Signals, p: Values, z: Values, speed: Value, onset: Value) -> Value:
        return speed * (1 - p["share"] + p["share"] * p["times"] * np.abs(s.drag) / onset)
