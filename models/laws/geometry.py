"""The capsule's shape and the tissue around it: the few lengths and angles that every law shares."""

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

GRAVITY = 9.81  # m/s^2
Regime = Literal["low", "high", "blend"]
"""Moduli of paper V: those of speeds below 20 mm/s, those above, or both with a blend about 20 mm/s."""


@dataclass(frozen=True)
class Capsule:
    """A cylinder with two hemispheres: radius R, cylinder length L, mass m (papers A and V, Fig. 1)."""

    radius_m: float = 6.5e-3
    cylinder_length_m: float = 20e-3
    mass_kg: float = 4.0e-3


@dataclass(frozen=True)
class Tissue:
    """The gut around the capsule: wall thickness d = l_m, contact angle alpha, nose angle theta, friction, mucus,
    recovery, and the set of moduli of paper V. Raises ValueError for an unknown set.
    """

    wall_thickness_m: float = 2.5e-3
    contact_angle_deg: float = 60.0
    nose_force_angle_deg: float = 30.0
    friction_coefficient: float = 0.082
    mucus_thickness_m: float = 30e-6
    recovery_time_s: float = 0.05
    regime: Regime = "low"

    def __post_init__(self) -> None:
        if self.regime not in get_args(Regime):
            raise ValueError(f"regime must be low, high or blend; got {self.regime!r}")

    @property
    def alpha(self) -> float:
        """Contact angle in rad."""
        return math.radians(self.contact_angle_deg)

    @property
    def theta(self) -> float:
        """Angle of the nose's resultant force in rad."""
        return math.radians(self.nose_force_angle_deg)


def relaxed_diameter(capsule: Capsule, tissue: Tissue) -> float:
    """`D0 = 2 R cos(alpha)` in m (paper V Eq. 5)."""
    return 2 * capsule.radius_m * math.cos(tissue.alpha)


def contact_angle_deg(lumen_diameter_m: float, radius_m: float) -> float:
    """Contact angle `arccos(D0/(2 R))` in deg in a relaxed lumen of diameter `D0` in m around a capsule of radius `R`
    in m. Raises ValueError unless the lumen is narrower than the capsule.
    """
    if not 0 < lumen_diameter_m < 2 * radius_m:
        rule = f"lumen_diameter_m must be positive and less than the capsule's {2 * radius_m:g} m"
        raise ValueError(f"{rule}; got {lumen_diameter_m:g}")
    return math.degrees(math.acos(lumen_diameter_m / (2 * radius_m)))


def shoulder_position(capsule: Capsule, tissue: Tissue) -> float:
    """`x_s = R sin(alpha)` in m: from the first contact of wall and nose to the begin of the cylinder."""
    return capsule.radius_m * math.sin(tissue.alpha)


def wall_diameter(distance_m: Any, capsule: Capsule, tissue: Tissue) -> Any:
    """`D(x) = 2 sqrt(R^2 - (x_s - x)^2)` up to the shoulder, `2 R` along the cylinder, in m (papers A and V, Fig. 1 and
    assumption 3); `distance_m` x from the first contact in m, any shape; `D(0) = D0`.
    """
    ahead = np.maximum(shoulder_position(capsule, tissue) - distance_m, 0)
    return 2 * np.sqrt(capsule.radius_m**2 - ahead**2)


def stretched_length(capsule: Capsule) -> float:
    """`L_s = L + R` in m, the length of wall that a dragged capsule stretches."""
    return capsule.cylinder_length_m + capsule.radius_m


def wall_section(capsule: Capsule, tissue: Tissue) -> float:
    """`s = pi (2 R d + d^2)` in m^2, the wall's section around the capsule (paper A Eq. 12)."""
    d = tissue.wall_thickness_m
    return math.pi * (2 * capsule.radius_m * d + d**2)
