"""Force against speed: environmental resistance, normal load, Coulomb limit, and the hyperelastic nose of paper A."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from models.laws.geometry import (
    GRAVITY,
    Capsule,
    Tissue,
    contact_angle_deg,
    relaxed_diameter,
    shoulder_position,
)
from models.laws.hyperelastic import WallConstants
from models.laws.resistance import (
    contact_pressure,
    environmental_resistance,
    mucus_drag,
    normal_load,
    pressure_integrals,
    sliding_resistance,
)
from models.laws.stick_slip import elastic_coulomb_limit, initial_resistance

CAPSULE, TISSUE = Capsule(), Tissue()
HEAVY = replace(CAPSULE, mass_kg=50.1e-3)
SPEEDS = np.array([0.5e-3, 1e-3, 5e-3, 10e-3, 20e-3])


def test_default_capsule_check_values():
    force = environmental_resistance(SPEEDS, CAPSULE, TISSUE)
    assert force == pytest.approx(np.array([42.77, 43.68, 55.70, 66.37, 77.19]) * 1e-3, rel=5e-4)
    limit = TISSUE.friction_coefficient * normal_load(SPEEDS, CAPSULE, TISSUE)
    assert limit == pytest.approx(np.array([36.68, 36.81, 38.74, 41.70, 47.50]) * 1e-3, rel=5e-4)


def test_heavy_capsule_check_values():
    low, high = (
        sliding_resistance(SPEEDS, HEAVY, TISSUE),
        sliding_resistance(np.array([20e-3, 40e-3, 60e-3]), HEAVY, replace(TISSUE, regime="high")),
    )
    assert low.environmental == pytest.approx(np.array([42.76, 43.68, 55.70, 66.37, 77.19]) * 1e-3, rel=2e-4)
    assert low.coulomb == pytest.approx(np.array([73.76, 73.89, 75.82, 78.78, 84.59]) * 1e-3, rel=2e-4)
    assert high.environmental == pytest.approx(np.array([63.78, 97.30, 125.49]) * 1e-3, rel=2e-4)
    assert high.coulomb == pytest.approx(np.array([80.08, 85.63, 92.12]) * 1e-3, rel=2e-4)
    assert sliding_resistance(10e-3, HEAVY, TISSUE).total == pytest.approx(147.7e-3, rel=5e-4)


@pytest.mark.parametrize(
    ("speed", "regime", "tolerance"), [(0.5e-3, "low", 1e-9), (1e-4, "low", 1e-6), (60e-3, "high", 1e-9)]
)
def test_quadrature_against_adaptive_integration(speed, regime, tolerance):
    tissue = replace(TISSUE, regime=regime)
    shoulder = shoulder_position(CAPSULE, tissue)
    span = {"epsabs": 0.0, "epsrel": 1e-11, "limit": 500}

    def density(x):
        return 2 * math.pi * CAPSULE.radius_m * contact_pressure(x, speed, CAPSULE, tissue)

    parts = np.concatenate([[0.0], np.geomspace(1e-9, shoulder, 12)])
    expected = sum(quad(density, a, b, **span)[0] for a, b in itertools.pairwise(parts))
    assert pressure_integrals(speed, CAPSULE, tissue)[0] == pytest.approx(expected, rel=tolerance)


def test_resistance_is_even_in_speed_and_rises_from_its_limit_of_rest():
    speeds = np.linspace(1e-4, 60e-3, 100)
    force = environmental_resistance(speeds, CAPSULE, TISSUE)
    assert environmental_resistance(-speeds, CAPSULE, TISSUE) == pytest.approx(force)
    assert np.all(np.diff(force) > 0)
    rest = environmental_resistance(0.0, CAPSULE, TISSUE)
    assert rest == pytest.approx(float(environmental_resistance(1e-7, CAPSULE, TISSUE)), rel=1e-4)
    assert 0 < rest < force[0]


def test_regimes_and_blend():
    low, high, blend = (
        environmental_resistance(np.array([5e-3, 20e-3, 40e-3]), CAPSULE, replace(TISSUE, regime=r))
        for r in ("low", "high", "blend")
    )
    assert blend == pytest.approx([low[0], (low[1] + high[1]) / 2, high[2]])
    with pytest.raises(ValueError, match="regime must be low, high or blend; got 'middle'"):
        replace(TISSUE, regime="middle")


def test_shape_is_kept():
    assert environmental_resistance(1e-3, CAPSULE, TISSUE).shape == ()
    assert environmental_resistance(np.full((2, 3), 1e-3), CAPSULE, TISSUE).shape == (2, 3)


def test_parts_add_up():
    force = sliding_resistance(SPEEDS, HEAVY, TISSUE)
    assert force.total == pytest.approx(force.environmental + force.viscous + force.coulomb)
    assert force.environmental == pytest.approx(environmental_resistance(SPEEDS, HEAVY, TISSUE))
    assert force.coulomb == pytest.approx(TISSUE.friction_coefficient * normal_load(SPEEDS, HEAVY, TISSUE))
    assert force.viscous == pytest.approx(mucus_drag(SPEEDS, TISSUE.mucus_thickness_m))


def test_weight_alone_presses_in_a_wall_without_strain():
    slack = replace(TISSUE, contact_angle_deg=0.0)
    assert normal_load(5e-3, CAPSULE, slack) == pytest.approx(CAPSULE.mass_kg * GRAVITY)
    assert environmental_resistance(5e-3, CAPSULE, slack) == pytest.approx(0.0, abs=1e-15)


def test_paper_a_forces_do_not_follow_from_its_parameters():
    tissue = replace(TISSUE, contact_angle_deg=30.0, friction_coefficient=0.015)
    wall = WallConstants.from_set()
    assert initial_resistance(CAPSULE, tissue, wall) == pytest.approx(502.7e-3, rel=2e-4)
    assert elastic_coulomb_limit(CAPSULE, tissue, wall) == pytest.approx(148.8e-3, rel=5e-4)


def test_lumen_diameter_gives_the_contact_angle():
    """Paper A measured 9 mm; the radius of 6.5 mm is its capsule's."""
    angle = contact_angle_deg(9e-3, CAPSULE.radius_m)
    assert angle == pytest.approx(46.2, abs=0.02)
    assert relaxed_diameter(CAPSULE, replace(TISSUE, contact_angle_deg=angle)) == pytest.approx(9e-3)
    for diameter in (0.0, 13e-3, math.nan):
        with pytest.raises(ValueError, match=r"lumen_diameter_m must be positive and less than the capsule's 0\.013 m"):
            contact_angle_deg(diameter, CAPSULE.radius_m)
