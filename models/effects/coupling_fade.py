"""The magnet's (or coil's) grip changes with time (heating)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class CouplingFade(Effect):
    """Drive gain `1 + b t + c t^2`."""

    id = "coupling_fade"
    summary = "the drive's grip changes with time"
    source = "tracing catalogue 20"
    kinds = frozenset({"magnetic", "coil", "vibro"})
    probe = 0.001
    look_alikes = ("tissue_drying",)
    separated_by = "an idle pause; logged current"

    rate_per_s: Parameter = Parameter("rate_per_s", 0.0, "1/s", -0.02, 0.02, "tracing catalogue 20", fit=True)

    bend_per_s2: Parameter = Parameter("bend_per_s2", 0.0, "1/s^2", -3e-4, 3e-4, "tracing catalogue 20", fit=True)

    def gain(self, s: Signals, p: Values, z: Values) -> Any:
        return np.maximum(1 + (p["rate_per_s"] + p["bend_per_s2"] * s.t) * s.t, 0.05)
