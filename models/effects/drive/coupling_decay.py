"""The magnet's grip changes along the track."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number


class CouplingDecay(Effect):
    """Drive gain `1 + g x + b x^2`."""

    id = "coupling_decay"
    words = "a coupling that changes along the track"
    summary = "the magnet's grip changes along the track"
    source = "tracing catalogue 23"
    kinds = frozenset({"magnetic", "coil"})
    needs = ("places",)
    probe = 1.0
    confounders = ("lumen_taper",)
    separated_by = "the drive off: a taper stays"

    slope_per_m = number(0.0, "1/m", -30.0, 30.0)
    bend_per_m2 = number(0.0, "1/m^2", -600.0, 600.0)

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return np.maximum(1 + (p["slope_per_m"] + p["bend_per_m2"] * s.x) * s.x, 0.05)
