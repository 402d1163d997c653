"""The coil's current lags the switch, and the force goes with its square."""

import numpy as np

from models.effects.effect import InnerMassEffect, Signals, Value, Values, number

_OFF = 1e-12  # share of the force below which the coil counts as off: the root's slope stays finite


class CoilLag(InnerMassEffect):
    """`tau i' = sqrt(u) - i` (tau = L/R) and force `F i^2`: half of it after 1.23 tau on the rise, after 0.35 tau on
    the fall, so the drive is on for 0.88 tau less than its duty says. A command u between off (0) and on (1) is a share
    of the force.
    """

    id = "coil_lag"
    words = "a lagging coil current"
    summary = "the coil's current lags the switch; the force goes with its square"
    source = "reluctance coil F = i^2/2 dL/dx, literature 2.1"
    kinds = frozenset({"vibro", "vibro_table"})
    states = ("current",)
    probe = 0.002
    confounders = ("actuator_lag", "coil_reach", "incline_gravity")
    separated_by = "the coil's current on an oscilloscope"

    time_s = number(0.0, "s", 0.0, 0.015, "coil with R 100 ohm: milliseconds")

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return z["current"] ** 2

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        kept = np.exp(-h / np.maximum(p["time_s"], 1e-9))
        final = np.sqrt(np.maximum(s.command, _OFF))
        return {"current": final + (z["current"] - final) * kept}
