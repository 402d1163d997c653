"""How much of a changed resistance the slip limit feels. Refines an effect, never named itself."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SOURCE = "paper V Eq. 11: of the normal load only what the wall presses follows the hoop stress, not the weight"


@dataclass(frozen=True)
class LevelAtOnset(Effect):
    """Where effects make F_e `l` times as large, the slip limit is `f_c = mu (m g (1 + (1 - k)(l - 1)) + l N_p)`, N_p what the wall
    presses: k is the share of the weight's friction that stays as it is. 0: all of f_c follows; 1: only what the wall presses does."""

    id = "level_at_onset"
    summary = "a share of the weight's friction that a changed resistance leaves as it is"
    source = _SOURCE
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = MappingProxyType({"kept": (1.0,)})
    probe = 0.1
    look_alikes = ("level_over_speed",)
    separated_by = "runs at one speed over places, times or directions that differ"

    kept: Parameter = Parameter("kept", 0.0, "1", -0.5, 1.5, _SOURCE, fit=True, spread=1.0)

    def onset(self, s: Signals, p: Values, z: Values, level: Any) -> Any:
        return level - p["kept"] * (level - 1)
