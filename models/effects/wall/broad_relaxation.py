"""A relaxation spectrum broader than two Maxwell branches: a springpot beside them."""

from typing import Any

from models.effects.effect import Effect, Value, Values, by_name, number
from models.effects.formula import Formula
from models.laws.dynamic_modulus import DynamicModulus, springpot_modulus

REFERENCE_HZ = 10.0  # at which the stiffness is stated


class BroadRelaxation(Effect):
    """Modulus `K (i f/10 Hz)^alpha` added to the wall's: a continuous, power-law spectrum.

    `f` in Hz, any shape, `K` in Pa at 10 Hz, `alpha` from near 0 (spring) to 0.6; nearer 1 it would be one
    damper and not a broad spectrum.
    """

    id = "broad_relaxation"
    words = "a broad relaxation spectrum"
    summary = "a relaxation spectrum broader than two Maxwell branches"
    source = "fractional Kelvin-Voigt solid; soft tissue exponents 0.1 to 0.4"
    kinds = frozenset({"dma"})
    grid = by_name(exponent=(0.1, 0.25, 0.4, 0.6))
    probe = 1e4
    confounders = ()
    separated_by = "frequencies over three decades"

    stiffness_Pa = number(0.0, "Pa", 0.0, 1e7)
    exponent = number(0.25, "1", 0.02, 0.6)

    def modulus(self, frequency_Hz: Value, p: Values) -> DynamicModulus:
        """Storage and loss modulus in Pa that the springpot adds at `frequency_Hz`, any shape."""
        return springpot_modulus(frequency_Hz / REFERENCE_HZ, 0.0, p["stiffness_Pa"], p["exponent"])

    @classmethod
    def further(cls, p: Values) -> list[tuple[str, str, Any]]:
        power = (Formula("i") * Formula("f") / REFERENCE_HZ) ** p["exponent"]
        return [("modulus", "added modulus in Pa", p["stiffness_Pa"] * power)]
