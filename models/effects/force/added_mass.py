"""Inertia beyond the capsule's."""

from models.effects.effect import Effect, Signals, Value, Values, number


class AddedMass(Effect):
    """Force `-m_a a`: fluid or rig mass moved along."""

    id = "added_mass"
    words = "an added mass"
    summary = "inertia beyond the capsule's"
    source = "tracing catalogue 16"
    kinds = frozenset({"pull"})
    needs = ("speeds",)
    states = (
        "acceleration",
        "speed",
    )
    probe = 0.01
    confounders = ("actuator_lag",)
    separated_by = "faster reversals"

    mass_kg = number(0.0, "kg", -0.005, 2.0)

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return -p["mass_kg"] * z["acceleration"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        return {"acceleration": (s.v - z["speed"]) / h, "speed": s.v}
