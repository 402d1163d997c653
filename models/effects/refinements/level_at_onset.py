"""Whether the nose or the slip limit feels a changed resistance. Refines an effect, never named itself."""

import numpy as np

from models.effects.effect import Effect, Shares, Value, Values, by_name, number

_WEIGHT = "paper V Eq. 11: of the normal load only what the wall presses follows the hoop stress, not the weight"
_SIDES = (
    "paper V Eq. 8 and 11: F_e is the wall's resistance at the nose, f_c what it takes to slip along the whole capsule"
)


class LevelAtOnset(Effect):
    """Where effects change resistance to `l` times what it was, `F_e (1 + (1 - max(-q, 0))(l - 1))` and the slip limit
    `f_c = mu (m g (1 + (1 - k)(l - 1)) + N_p (1 + (1 - max(q, 0))(l - 1)))`, N_p what the wall presses: k is the share
    of the weight's friction that stays as it is. q = 0: all but that follows; q = 1: F_e alone and not N_p; q = -1: the
    slip limit alone and not F_e. Both may go half beyond, for a search on a base that is still wrong takes that way.
    """

    id = "level_at_onset"
    words = "separate friction scales of nose and slip limit"
    summary = "a nose or a slip limit that a changed resistance leaves as it is"
    source = _SIDES
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = by_name(kept=(1.0,), spared=(0.0, 1.0, -1.0))
    probe = 0.1
    confounders = ("level_over_speed",)
    separated_by = "runs at one speed over places, times or directions that differ"

    kept = number(0.0, "1", -0.5, 1.5, _WEIGHT, spread=1.0)
    spared = number(0.0, "1", -1.5, 1.5, _SIDES, spread=1.0)

    def shared(self, p: Values, factors: Shares) -> Shares:
        nose, weight, pressed = factors
        q = p["spared"]
        return _less(nose, np.maximum(-q, 0.0)), _less(weight, p["kept"]), _less(pressed, np.maximum(q, 0.0))


def _less(level: Value, share: Value) -> Value:
    return level - share * (level - 1)
