"""A break-away peak that grows with the time at rest."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number


class DwellAdhesion(Effect):
    """Level `1 + b th`: `th` grows at rest as `1 - exp(-t/t_a)` and fades over the slip length."""

    id = "dwell_adhesion"
    words = "an adhesion that grows at rest"
    summary = "a break-away peak that grows with the time at rest"
    source = "rate and state ageing, Dillavou arXiv:1908.02676"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("rests",)
    states = ("age",)
    grid = by_name(ageing_time_s=(0.5, 3.0), slip_length_m=(0.0003, 0.002))
    probe = 0.1
    confounders = ("stribeck", "stress_relaxation")
    separated_by = "slide, hold, slide with holds of 0.1 to 30 s"
    refined_by = ("level_at_onset",)

    peak = number(0.0, "1", -0.5, 3.0)
    ageing_time_s = number(2.0, "s", 0.1, 60.0)
    slip_length_m = number(0.0005, "m", 5e-05, 0.01)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 + p["peak"] * z["age"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        rest = np.where(np.abs(s.v) < 1e-6, 1.0, 0.0)
        aged = 1 - (1 - z["age"]) * np.exp(-h / p["ageing_time_s"])
        return {"age": np.where(rest == 1, aged, z["age"] * np.exp(-np.abs(s.v) * h / p["slip_length_m"]))}
