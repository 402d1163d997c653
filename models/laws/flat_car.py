"""The flat car on a nonlinear spring: stick-slip of a capsule at 10 mm/s as paper C models it (Eq. 4-9)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from models.laws.hyperelastic import WallConstants, circumferential_stress, longitudinal_stress
from models.laws.stick_slip import where_it_reaches
from models.parameter import load_set


@dataclass(frozen=True)
class FlatCar:
    """Contact area and angles of the model: radius R, length L of the whole capsule, contact angle alpha, force angle
    theta (rad), car speed v_c.
    """

    radius_m: float
    length_m: float
    alpha: float
    theta: float
    car_speed_m_s: float
    wall: WallConstants

    @classmethod
    def from_set(cls) -> FlatCar:
        """Read the printed parameters (paper C Table 1)."""
        s = load_set("zhang2014_constant_velocity")
        alpha, theta = (math.radians(s[key]) for key in ("contact_angle_deg", "force_angle_deg"))
        return cls(s["radius_m"], s["capsule_length_m"], alpha, theta, s["car_speed_m_s"], WallConstants.from_set())

    @property
    def contact_area(self) -> float:
        """`S = 2 pi R^2 cos(alpha)` in m^2 (paper C Eq. 6)."""
        return 2 * math.pi * self.radius_m**2 * math.cos(self.alpha)

    @property
    def limiting_stretch(self) -> float:
        """`1/cos(alpha)`: the hoop stretch at which the car is said to let go (paper C Section 3.3)."""
        return 1 / math.cos(self.alpha)

    def spring_force(self, time: Any) -> Any:
        """`f_el = sigma_l(1 + v_c t/L) S` in N after `time` in s, any shape (paper C Eq. 5, 7).

        Eq. 7 prints `v_c t/L` for the stretch itself, which would be 0 at the start; the stretch counts from 1.
        """
        return longitudinal_stress(1 + self.car_speed_m_s * time / self.length_m, self.wall) * self.contact_area

    def time_to(self, force_N: float) -> float:
        """When the spring carries `force_N`, in s; `ValueError` unless it is positive."""
        if not force_N > 0:
            raise ValueError(f"force_N must be positive; got {force_N:g}")
        return where_it_reaches(self.spring_force, force_N, 0.01, 1e-14)

    def hoop_stress_for(self, spring_force_N: Any) -> Any:
        """`sigma_c = f_el/(tan(theta) S)` in Pa that goes with a spring force, any shape (paper C Eq. 8, 9)."""
        return spring_force_N / math.tan(self.theta) / self.contact_area

    def limiting_hoop_stress(self) -> float:
        """`sigma_c(1/cos(alpha))` in Pa: 24 MPa at 60 deg, which no spring force of some mN can balance."""
        return float(circumferential_stress(self.limiting_stretch, self.wall))
