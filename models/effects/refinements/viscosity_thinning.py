"""How a viscous wall's resistance thins with its rate. Refines an effect, never named itself."""

from models.effects.effect import Effect, Signals, Value, Values, by_name, number
from models.effects.wall.wall_viscosity import WallViscosity


class ViscosityThinning(Effect):
    """Wall force `c u' ((1 + (u'/u_0')^2)^(n/2) - 1)` beyond `c u'`: together Carreau's law, one plateau."""

    id = "viscosity_thinning"
    words = "a shear-thinning wall"
    summary = "a viscous wall that thins with its rate"
    source = "Carreau's law of a viscosity that changes with the rate, Trans. Soc. Rheol. 16 (1972) 99"
    kinds = WallViscosity.kinds
    of = WallViscosity.id
    grid = by_name(power=(0.0,), rate_m_s=(2e-3,))
    probe = 0.1
    confounders = (WallViscosity.id,)
    separated_by = "speeds over two decades"

    power = number(0.0, "1", -0.9, 0.5, spread=0.3)
    rate_m_s = number(2e-3, "m/s", 1e-4, 2e-2)

    def wall_force(self, s: Signals, p: Values, z: Values) -> Value:
        ratio = s.drag_rate / p["rate_m_s"]
        return p["viscosity_N_s_per_m"] * s.drag_rate * ((1 + ratio * ratio) ** (p["power"] / 2) - 1)
