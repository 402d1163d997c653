"""Hoop stress of the viscoelastic wall around a moving capsule: five elements, two sets (paper V Eq. 3-7, 13, Table
3).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.parameter import load_set


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


def blend_weight(speed: Any, centre_m_s: float = 0.020, width_m_s: float = 0.002) -> Any:
    """Share of the high-speed set, 0 below and 1 above `centre`, a smooth step over about `width` (paper V jumps at 20
    mm/s).
    """
    s = np.clip((speed - centre_m_s) / width_m_s + 0.5, 0.0, 1.0)
    return s * s * (3 - 2 * s)


def hoop_stress(strain: Any, distance_m: Any, speed_m_s: Any, moduli: Moduli) -> Any:
    """`tau = e (E1 exp(-E1 x/(eta1 v)) + E2 exp(-E2 x/(eta2 v)) + E3)` in Pa: the wall met the nose `x/v` ago (paper V
    Eq. 4).
    """
    return strain * moduli.relaxation(distance_m / speed_m_s)
