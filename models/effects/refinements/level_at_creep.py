"""What a law of speed or direction makes of a body that creeps or rests. Refines an effect, never named itself."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number


class LevelAtCreep(Effect):
    """Level `1 + (e + d o) exp(-|v|/v_c)`, d the (last) direction: a law's changed level comes with the speed."""

    id = "level_at_creep"
    words = "a different friction at creep"
    summary = "resistance in creep and at rest that differs from the one in motion"
    source = "no law: friction of a body that creeps or rests need not be what it was in the last motion"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    by_speed = True
    probe = 0.02
    confounders = ("stribeck", "dwell_adhesion")
    separated_by = "rests after motions in both directions"

    odd = number(0.0, "1", -0.9, 0.9, spread=0.3)
    even = number(0.0, "1", -0.9, 0.9, spread=0.3)
    speed_m_s = number(2e-4, "m/s", 1e-6, 2e-3)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        creep = np.exp(-np.abs(s.v) / p["speed_m_s"])
        return np.maximum(1 + (p["even"] + s.direction * p["odd"]) * creep, 0.05)
