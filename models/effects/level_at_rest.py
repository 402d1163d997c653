"""What a law of speed or direction makes of a body at rest. Refines an effect, never named itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SOURCE = "no law: friction at rest need not be what it was in the last motion"
_REST = 1e-6  # m/s


@dataclass(frozen=True)
class LevelAtRest(Effect):
    """Level `1 + e + d o` at rest, d the direction of the last motion; 1 in motion."""

    id = "level_at_rest"
    summary = "resistance at rest that differs from the one in motion"
    source = _SOURCE
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.02
    look_alikes = ("stribeck", "dwell_adhesion")
    separated_by = "rests after motions in both directions"

    odd: Parameter = Parameter("odd", 0.0, "1", -0.9, 0.9, _SOURCE, fit=True, spread=0.3)
    even: Parameter = Parameter("even", 0.0, "1", -0.9, 0.9, _SOURCE, fit=True, spread=0.3)

    def level(self, s: Signals, p: Values, z: Values) -> Any:
        return np.where(np.abs(s.v) < _REST, np.maximum(1 + p["even"] + s.direction * p["odd"], 0.05), 1.0)
