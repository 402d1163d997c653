"""Resistance and Coulomb limit of a capsule in a purely hyperelastic gut (paper A Eq. 6-11)."""

import math
from typing import Any

from models.laws.geometry import Capsule, Tissue, relaxed_diameter, shoulder_position, wall_diameter
from models.laws.hyperelastic import WallConstants, circumferential_stress
from models.laws.resistance import integrate_along


def elastic_pressure(diameter_m: Any, capsule: Capsule, tissue: Tissue, wall: WallConstants) -> Any:
    """`P = 2 d H_c(D/D0)/D` in Pa for a wall around the diameter `D` in m, any shape (paper A Eq. 7, 9)."""
    stress = circumferential_stress(diameter_m / relaxed_diameter(capsule, tissue), wall)
    return 2 * tissue.wall_thickness_m * stress / diameter_m


def _nose_load(capsule: Capsule, tissue: Tissue, wall: WallConstants) -> float:
    def density(x: Any, _speed: Any) -> Any:
        return (
            2 * math.pi * capsule.radius_m * elastic_pressure(wall_diameter(x, capsule, tissue), capsule, tissue, wall)
        )

    return float(integrate_along(density, 0.0, 0.0, shoulder_position(capsule, tissue)))


def initial_resistance(capsule: Capsule, tissue: Tissue, wall: WallConstants) -> float:
    """`F_initial = F_e = sin(alpha) int_0^{R sin(alpha)} 2 pi R P dx` in N, independent of speed (paper A Eq. 6, 10).

    With the printed parameters (alpha 30 deg) this is 502.7 mN where the paper states 23.23 mN.
    """
    return math.sin(tissue.alpha) * _nose_load(capsule, tissue, wall)


def elastic_coulomb_limit(capsule: Capsule, tissue: Tissue, wall: WallConstants) -> float:
    """`f_c = mu [cos(alpha) int_0^{R sin(alpha)} 2 pi R P dx + 2 pi R L P_m]` in N, without weight (paper A Eq. 8, 9).

    `P_m` is the pressure on the cylinder, `D = 2 R`. With the printed parameters 148.8 mN where the paper states
    39.79 - 23.23 = 16.56 mN.
    """
    R = capsule.radius_m
    cylinder = 2 * math.pi * R * capsule.cylinder_length_m * elastic_pressure(2 * R, capsule, tissue, wall)
    return float(tissue.friction_coefficient * (math.cos(tissue.alpha) * _nose_load(capsule, tissue, wall) + cylinder))
