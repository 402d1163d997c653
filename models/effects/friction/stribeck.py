"""Extra resistance at low speed that fades as speed grows."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number

_REST = 1e-9  # m/s, keeps the power's derivative finite


class Stribeck(Effect):
    """Level `1 + s exp(-(|v|/v_s)^k)`: excess at `|v| < v_s` only, no memory; k is 2 classically, measured 1/2 to 2."""

    id = "stribeck"
    words = "a Stribeck effect"
    summary = "extra resistance at low speed that fades as speed grows"
    source = "Stribeck curve; Monatsh. Chem. 2016 for mucus"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "vibro_table", "axis", "friction"})
    needs = ("speeds",)
    grid = by_name(speed_m_s=(0.001, 0.003, 0.01))
    by_speed = True
    probe = 0.1
    confounders = ("dwell_adhesion", "viscous_drag")
    separated_by = "vary the dwell at fixed speed; speeds over two decades"
    refined_by = ("level_at_onset", "level_at_creep", "level_over_speed")

    excess = number(0.0, "1", -0.8, 3.0)
    speed_m_s = number(0.003, "m/s", 0.0002, 0.05)
    exponent = number(2.0, "1", 0.5, 4.0, "Armstrong-Helouvry 1991: 1/2 to 2", spread=1.0)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 + p["excess"] * np.exp(-((np.maximum(np.abs(s.v), _REST) / p["speed_m_s"]) ** p["exponent"]))
