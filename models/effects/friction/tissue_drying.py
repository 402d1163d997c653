"""Resistance that drifts with time."""

from models.effects.effect import Signals, Value, Values
from models.effects.in_time import DriftInTime, drift


class TissueDrying(DriftInTime):
    """Level `1 + b s + c s^2` in a clock time s that settles, also at rest."""

    id = "tissue_drying"
    words = "drying tissue"
    summary = "resistance drifts with time"
    source = "paper C Section 2.2 (drying in air)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("time",)
    confounders = ("preconditioning", "coupling_fade", "lumen_taper")
    separated_by = "wait without moving"
    refined_by = ("level_at_onset", "drying_shape")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return drift(s.t, p)
