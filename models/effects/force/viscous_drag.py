"""Extra resistance proportional to (or a power of) speed."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number

_CREEP = 1e-6  # m/s


class ViscousDrag(Effect):
    """Force `-c sgn(v) (|v|/10 mm/s)^n`, odd in speed, no memory."""

    id = "viscous_drag"
    words = "a viscous drag"
    summary = "extra resistance that grows with speed"
    source = "Tribol. Lett. 51:377; shear-thinning mucus n 0.3 to 0.6"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "vibro_table", "axis", "friction"})
    needs = ("speeds",)
    grid = by_name(exponent=(0.5, 1.0, 1.5))
    probe = 0.002
    confounders = ("stribeck", "wall_viscosity", "back_emf")
    separated_by = "two drive amplitudes; speeds over two decades"
    refined_by = ("level_over_speed",)

    coefficient_N = number(0.0, "N at 10 mm/s", 0.0, 0.3)
    exponent = number(1.0, "1", 0.4, 2.0)

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        fast = np.maximum(np.abs(s.v), _CREEP)  # below it linear, so that the slope at rest is finite
        return -p["coefficient_N"] * s.v / 0.01 * (fast / 0.01) ** (p["exponent"] - 1)
