"""How much of a changed resistance the slip limit feels. Refines an effect, never named itself."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SOURCE = "paper V Eq. 11: of the normal load only what the wall presses follows the hoop stress, not the weight"
_APART = "paper V Eq. 8 and 11: F_e is the wall's resistance at the nose, f_c what it takes to slip along the whole capsule"


@dataclass(frozen=True)
class LevelAtOnset(Effect):
    """Where effects make F_e `l` times as large, the slip limit is `f_c = mu (m g (1 + (1 - k)(l - 1)) + N_p (1 + (1 - q)(l - 1)))`, N_p
    what the wall presses: k and q are the shares of either friction that stay as they are. Both 0: all of f_c follows; k = 1: only what
    the wall presses does; both 1: the change is one of F_e alone."""

    id = "level_at_onset"
    summary = "a share of the slip limit that a changed resistance leaves as it is"
    source = _SOURCE
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = MappingProxyType({"kept": (1.0,), "spared": (0.0, 1.0)})
    probe = 0.1
    look_alikes = ("level_over_speed",)
    separated_by = "runs at one speed over places, times or directions that differ"

    kept: Parameter = Parameter("kept", 0.0, "1", -0.5, 1.5, _SOURCE, fit=True, spread=1.0)
    spared: Parameter = Parameter("spared", 0.0, "1", -0.5, 1.5, _APART, fit=True, spread=1.0)

    def onset(self, s: Signals, p: Values, z: Values, level: Any) -> Any:
        return level - p["kept"] * (level - 1)

    def pressed(self, s: Signals, p: Values, z: Values, level: Any) -> Any:
        return level - p["spared"] * (level - 1)
