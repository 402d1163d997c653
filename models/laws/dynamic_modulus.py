"""Storage and loss modulus of the wall under oscillating shear: five elements (paper V Eq. 14-19) and a springpot."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from models.laws.hoop import Moduli

Reading = Literal["hertz", "radians"]


@dataclass(frozen=True)
class DynamicModulus:
    """Storage modulus Y1 and loss modulus Y2 in Pa, each a number, an array over frequency or a CasADi expression."""

    storage: Any
    loss: Any


def angular_frequency(frequency_Hz: Any, reading: Reading = "hertz") -> Any:
    """`omega = 2 pi f` in rad/s, or the printed number itself where "Hz" is read as rad/s ("radians")."""
    if reading not in ("hertz", "radians"):
        raise ValueError(f"reading must be hertz or radians; got {reading!r}")
    return frequency_Hz * (2 * math.pi if reading == "hertz" else 1.0)


def maxwell_branch(omega: Any, modulus: Any, viscosity: Any) -> DynamicModulus:
    """A spring E in series with a damper eta: `Y1 = E q^2/(1 + q^2)`, `Y2 = E q/(1 + q^2)`, `q = omega eta/E`; omega in
    rad/s.
    """
    q = omega * viscosity / modulus
    return DynamicModulus(modulus * q**2 / (1 + q**2), modulus * q / (1 + q**2))


def five_element_modulus(omega: Any, moduli: Moduli) -> DynamicModulus:
    """`Y(i omega) = Q/P` of two Maxwell branches and a spring side by side; `omega` in rad/s, any shape, moduli in Pa
    and Pa s.

    The sum over the branches equals the paper's Eq. 19, `p0 = E1 E2`, `p1 = E2 eta1 + E1 eta2`, `p2 = eta1 eta2`, `q0 =
    E1 E2 E3`, `q1 = (E1 + E3) E2 eta1 + (E2 + E3) E1 eta2`, `q2 = (E1 + E2 + E3) eta1 eta2`. Source: paper V Eq. 14-19.
    """
    first = maxwell_branch(omega, moduli.E1, moduli.eta1)
    second = maxwell_branch(omega, moduli.E2, moduli.eta2)
    return DynamicModulus(first.storage + second.storage + moduli.E3, first.loss + second.loss)


def springpot_modulus(omega: Any, spring_Pa: Any, springpot: Any, order: Any) -> DynamicModulus:
    """`Y(i omega) = E0 + C (i omega)^a`: a spring beside a fractional element, a broad spectrum from three numbers.

    `Y1 = E0 + C omega^a cos(pi a/2)`, `Y2 = C omega^a sin(pi a/2)`; `omega` in rad/s, any shape, E0 in Pa, C in Pa s^a,
    0 <= a <= 1. Not from a seed paper: the usual fractional Kelvin-Voigt element, for comparison with the five
    elements.
    """
    size = springpot * omega**order
    return DynamicModulus(spring_Pa + size * np.cos(math.pi / 2 * order), size * np.sin(math.pi / 2 * order))
