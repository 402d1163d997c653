"""The magnet's (or coil's) grip changes with time (heating)."""

from models.effects.effect import Signals, Value, Values
from models.effects.in_time import DriftInTime, drift


class CouplingFade(DriftInTime):
    """Drive gain `1 + b s + c s^2` in a time s that settles."""

    id = "coupling_fade"
    words = "a coupling that fades with time"
    summary = "the drive's grip changes with time"
    source = "tracing catalogue 20"
    kinds = frozenset({"magnetic", "coil", "vibro"})
    needs = ("time",)
    confounders = ("tissue_drying",)
    separated_by = "an idle pause; logged current"

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return drift(s.t, p)
