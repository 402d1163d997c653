"""Dry friction between the inner mass and its guide."""

import numpy as np

from models.effects.effect import InnerMassEffect, Value, Values, number

CREEP_SPEED = 2.0e-3  # m/s, below which dry friction passes through 0


class GuideFriction(InnerMassEffect):
    """Force `F_d xi'/sqrt(xi'^2 + v_0^2)`, `v_0` 2 mm/s: constant against the relative motion, hardly any at rest."""

    id = "guide_friction"
    words = "a dry friction of the guide"
    summary = "dry friction of the inner mass in its guide"
    source = "Coulomb friction of a plain bearing"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 0.1
    confounders = ("spring_damping",)
    separated_by = "ring-down of the inner mass with the body held: straight for dry friction, exponential for damping"

    friction_N = number(0.0, "N", 0.0, 0.6, "up to the inner mass's weight")

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        return p["friction_N"] * rate / np.sqrt(rate * rate + CREEP_SPEED**2)
