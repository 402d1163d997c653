"""Resistance that changes steadily along the lumen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class LumenTaper(Effect):
    """Level `1 + g x + b x^2 + c x^3`: narrowing lumen or capstan bend, the change itself changing along the way."""

    id = "lumen_taper"
    summary = "resistance changes steadily along the lumen"
    source = "tracing catalogue 11, 12"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "axis"})
    probe = 2.0
    look_alikes = ("tissue_drying", "stenosis")
    separated_by = "a return pass over the same places"
    refined_by = ("level_at_onset",)

    slope_per_m: Parameter = Parameter("slope_per_m", 0.0, "1/m", -30.0, 30.0, "tracing catalogue 11, 12", fit=True)
    bend_per_m2: Parameter = Parameter("bend_per_m2", 0.0, "1/m^2", -600.0, 600.0, "tracing catalogue 11, 12", fit=True)

    curl_per_m3: Parameter = Parameter("curl_per_m3", 0.0, "1/m^3", -2e4, 2e4, "tracing catalogue 11, 12", fit=True)

    def level(self, s: Signals, p: Values, z: Values) -> Any:
        return np.maximum(1 + (p["slope_per_m"] + (p["bend_per_m2"] + p["curl_per_m3"] * s.x) * s.x) * s.x, 0.05)
