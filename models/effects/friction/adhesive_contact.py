"""The surfaces attract each other: friction at no load."""

from models.effects.effect import Effect, Signals, Value, Values, number


class AdhesiveContact(Effect):
    """A constant load N_0 in addition to the one that is applied, `F = mu (N + N_0)`: a coefficient that is referred
    to the applied load falls as that load grows.
    """

    id = "adhesive_contact"
    words = "an adhesive contact"
    summary = "adhesion presses the surfaces together in addition to the load"
    source = "Derjaguin 1934: friction of adhering surfaces, mu (N + N_0)"
    kinds = frozenset({"friction"})
    needs = ("load",)
    probe = 0.02
    confounders = ("load_dependent_friction", "hertzian_contact")
    separated_by = "loads over a factor of ten, down to none: adhesion leaves friction at no load"

    load_N = number(0.0, "N", -10.0, 100.0)

    def normal_load(self, s: Signals, p: Values, z: Values) -> Value:
        return p["load_N"]
