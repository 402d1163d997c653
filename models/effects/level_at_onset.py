"""How much of a changed resistance the slip limit feels. Refines an effect, never named itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SOURCE = "paper V Eq. 11: of the normal load only what the wall presses follows the hoop stress, not the weight"


@dataclass(frozen=True)
class LevelAtOnset(Effect):
    """Where effects make F_e `l` times as large, the slip limit f_c becomes `1 + (1 - k)(l - 1)` times as large, k the share that it
    lacks."""

    id = "level_at_onset"
    summary = "a share of the changed resistance that the slip limit lacks"
    source = _SOURCE
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.02
    look_alikes = ("level_over_speed",)
    separated_by = "runs at one speed over places, times or directions that differ"

    lack: Parameter = Parameter("lack", 0.0, "1", -0.5, 1.5, _SOURCE, fit=True, spread=0.1)

    def onset(self, s: Signals, p: Values, z: Values, level: Any) -> Any:
        return level - p["lack"] * (level - 1)
