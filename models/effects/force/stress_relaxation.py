"""A force that builds up while moving and relaxes with its own time constant."""

from typing import Any, ClassVar

import numpy as np

from models.effects.effect import Effect, Signals, Values, by_name, number


class StressRelaxation(Effect):
    """Maxwell branch that slips, force `-k q`, `q' = v/(1 + b |v|) - q/tau - c |v| q`: it relaxes with time and on the
    way, c = 0 never slips, and b > 0 is drawn less and less as speed grows, as a material that thins.
    """

    id = "stress_relaxation"
    words = "a stress relaxation of the wall"
    summary = "a force that builds up while moving and relaxes"
    source = "rat gut SLS, WJG 11:4974; five-element model (Kim)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("wall",)
    states = ("stretch_m",)
    grid = by_name(time_s=(0.15, 0.4, 1.0, 3.0, 8.0))
    probe = 1.0
    confounders: ClassVar[tuple[str, ...]] = ("viscous_drag", "wall_viscosity", "stribeck")
    separated_by = "frequency sweep at fixed amplitude; stop and hold"
    refined_by: ClassVar[tuple[str, ...]] = ("further_relaxation",)

    stiffness_N_per_m = number(0.0, "N/m", -30.0, 300.0)
    time_s = number(1.0, "s", 0.05, 20.0)
    slip_per_m = number(0.0, "1/m", 0.0, 2000.0, "as a bristle's: LuGre, Canudas 1995")
    thinning_s_per_m = number(0.0, "s/m", 0.0, 5000.0, "shear thinning: Cross, J. Colloid Sci. 20 (1965) 417")

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        return -p["stiffness_N_per_m"] * z["stretch_m"]

    def advance(self, s: Signals, p: Values, z: Values, h: Any) -> dict[str, Any]:
        fading = 1 / p["time_s"] + np.abs(s.v) * p["slip_per_m"]
        decay = np.exp(-h * fading)
        drawn = s.v / (1 + np.abs(s.v) * p["thinning_s_per_m"])
        return {"stretch_m": z["stretch_m"] * decay + drawn / fading * (1 - decay)}
