"""Friction that grows with the load that an axis carries."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number


class LoadDependentFriction(Effect):
    """Level `1 + c |load|` of the logged load, whichever its unit."""

    id = "load_dependent_friction"
    words = "a load-dependent friction"
    summary = "friction that grows with the logged load"
    source = "load-dependent friction of robot joints: Hamon et al. 2010; Bittencourt and Gunnarsson 2012"
    kinds = frozenset({"axis", "friction"})
    needs = ("load",)
    probe = 0.1
    confounders = ("directional_asymmetry", "lumen_taper", "adhesive_contact", "hertzian_contact")
    separated_by = "the same motion under loads that differ by a factor of two and more"

    growth_per_load = number(0.0, "1/(N or N m)", -1e3, 1e3)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return np.maximum(1 + p["growth_per_load"] * np.abs(s.load), 0.05)
