"""Wall tension that depends on the rate of stretch."""

from models.effects.effect import Effect, Signals, Value, Values, number


class WallViscosity(Effect):
    """Extra wall force `c u'`; the wall slips by its elastic tension alone."""

    id = "wall_viscosity"
    words = "a viscous wall"
    summary = "wall tension depends on the rate of stretch"
    source = "rat gut SLS, WJG 11:4974"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "periods"})
    needs = ("speeds",)
    probe = 0.3
    confounders = ("viscous_drag", "small_strain_stiffening")
    refined_by = ("viscosity_thinning",)
    separated_by = "frequency sweep at fixed amplitude; the force while the wall draws back"

    viscosity_N_s_per_m = number(0.0, "N s/m", -1.0, 30.0)

    def wall_force(self, s: Signals, p: Values, z: Values) -> Value:
        return p["viscosity_N_s_per_m"] * s.drag_rate
