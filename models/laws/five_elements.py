"""The viscoelastic wall of paper V, five elements: hoop stress (Eq. 3-7, 13, Table 3), dynamic moduli (Eq. 14-19)."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from models.parameter import load_set

_JUMP_M_S, _WIDE_M_S = 0.020, 0.002  # middle and width of the step between the two sets


@dataclass(frozen=True)
class Moduli:
    """Springs E1, E2, E3 in Pa and dampers eta1, eta2 in Pa s; each a number or an array over strain."""

    E1: Any
    E2: Any
    E3: Any
    eta1: Any
    eta2: Any

    def relaxation(self, time: Any) -> Any:
        """Relaxation modulus `E1 exp(-E1 t/eta1) + E2 exp(-E2 t/eta2) + E3` in Pa at `time` in s (paper V Eq. 3)."""
        return self.E1 * np.exp(-self.E1 * time / self.eta1) + self.E2 * np.exp(-self.E2 * time / self.eta2) + self.E3


def low_speed_moduli(strain: Any) -> Moduli:
    """Moduli quadratic in the hoop strain e (any shape), from shear relaxation; for speeds below 20 mm/s.

    Source: paper V Eq. 13, minus signs restored, fitted there to Table 1.
    """
    s = load_set("zhang2014_viscoelastic_low")
    names = ("E1", "E2", "E3", "eta1", "eta2")
    return Moduli(*(s[f"{n}_e2"] * strain**2 + s[f"{n}_e1"] * strain + s[f"{n}_e0"] for n in names))


def high_speed_moduli() -> Moduli:
    """Constant moduli from dynamic shear tests (paper V Table 3); for speeds of 20 to 60 mm/s."""
    s = load_set("zhang2014_viscoelastic_high")
    return Moduli(s["E1"], s["E2"], s["E3"], s["eta1"], s["eta2"])


def blend_weight(speed: Any) -> Any:
    """Share of the high-speed set at `speed` in m/s: a smooth step from 0 to 1 about 20 mm/s (where paper V jumps)."""
    s = np.clip((speed - _JUMP_M_S) / _WIDE_M_S + 0.5, 0.0, 1.0)
    return s * s * (3 - 2 * s)


def hoop_stress(strain: Any, distance_m: Any, speed_m_s: Any, moduli: Moduli) -> Any:
    """`tau = e (E1 exp(-E1 x/(eta1 v)) + E2 exp(-E2 x/(eta2 v)) + E3)` in Pa: the wall met the nose `x/v` ago (paper V
    Eq. 4).
    """
    return strain * moduli.relaxation(distance_m / speed_m_s)


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
    """A spring E in series with a damper eta: `Y1 = E q^2/(1 + q^2)`, `Y2 = E q/(1 + q^2)`, `q = omega eta/E`."""
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
