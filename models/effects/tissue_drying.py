"""Resistance that drifts with time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class TissueDrying(Effect):
    """Level `1 + b t + c t^2 + d t^3` in clock time, also at rest."""

    id = "tissue_drying"
    summary = "resistance drifts with time"
    source = "paper C Section 2.2 (drying in air)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.001
    look_alikes = ("preconditioning", "coupling_fade", "lumen_taper")
    separated_by = "wait without moving"
    refined_by = ("level_at_onset",)

    rate_per_s: Parameter = Parameter("rate_per_s", 0.0, "1/s", -0.02, 0.03, "paper C Section 2.2 (drying in air)", fit=True)

    bend_per_s2: Parameter = Parameter("bend_per_s2", 0.0, "1/s^2", -3e-4, 3e-4, "paper C Section 2.2 (drying in air)", fit=True)

    curl_per_s3: Parameter = Parameter("curl_per_s3", 0.0, "1/s^3", -5e-6, 5e-6, "paper C Section 2.2 (drying in air)", fit=True)

    def level(self, s: Signals, p: Values, z: Values) -> Any:
        return np.maximum(1 + (p["rate_per_s"] + (p["bend_per_s2"] + p["curl_per_s3"] * s.t) * s.t) * s.t, 0.05)
