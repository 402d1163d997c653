"""The inner mass reaches its stops."""

import numpy as np

from models.effects.effect import InnerMassEffect, Value, Values, by_name, number


class EndStopImpact(InnerMassEffect):
    """Stops on both sides: `k_s max(d + t_s d', 0)` against the displacement `d = |xi| - gap` beyond the gap, d > 0;
    the loss time `t_s` damps the impact (Kelvin-Voigt), and a stop never pulls.
    """

    id = "end_stop_impact"
    words = "an impact on the end stops"
    summary = "the inner mass hits a stop"
    source = "literature 1.1, stops k2 and k3"
    kinds = frozenset({"vibro", "vibro_table"})
    grid = by_name(gap_m=(0.002, 0.004, 0.007, 0.012))
    probe = 300.0
    confounders = ("spring_hardening",)
    separated_by = "two drive amplitudes; the sound of the impacts"

    stiffness_N_per_m = number(0.0, "N/m", 0.0, 5e4, "rubber to plastic stops")
    gap_m = number(0.01, "m", 0.0005, 0.03, "travel of the inner mass")
    loss_s = number(2e-4, "s", 0.0, 5e-3, "loss factor of rubber 0.05 to 1 at 100 Hz")

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        beyond = np.maximum(np.abs(stretch) - p["gap_m"], 0.0)
        pressed = np.maximum(beyond + p["loss_s"] * np.sign(stretch) * rate, 0.0)
        return p["stiffness_N_per_m"] * np.where(beyond > 0, np.sign(stretch) * pressed, 0.0)
