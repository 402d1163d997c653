"""The finer shape of a drift of the resistance. Refines an effect, never named itself."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number
from models.effects.friction.tissue_drying import TissueDrying
from models.effects.in_time import settling_time

_MINUTE_S = 60.0  # time after which both shapes are the same


class DryingShape(Effect):
    """Level `1 + d u^3 + e u^4 + f u^5`, `u = s/s(60 s)` the drying's own time over a minute's; never below 0.05."""

    id = "drying_shape"
    words = "a free curve of the drying"
    summary = "the finer shape of a drift of the resistance"
    source = "no law: a drift settles as it likes"
    kinds = TissueDrying.kinds
    of = TissueDrying.id
    probe = 0.01
    confounders = (TissueDrying.id,)
    separated_by = "longer records"

    third, fourth, fifth = (number(0.0, "1", -1.0, 1.0, spread=0.1) for _ in range(3))

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        u = settling_time(s.t, p) / settling_time(_MINUTE_S, p)
        return np.maximum(1 + (p["third"] + (p["fourth"] + p["fifth"] * u) * u) * u**3, 0.05)
