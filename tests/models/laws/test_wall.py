"""The wall's laws: hyperelastic stress, tension, hoop stress, mucus drag."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.laws.five_elements import blend_weight, high_speed_moduli, hoop_stress, low_speed_moduli
from models.laws.geometry import (
    Capsule,
    Tissue,
    relaxed_diameter,
    shoulder_position,
    stretched_length,
    wall_diameter,
    wall_section,
)
from models.laws.hyperelastic import WallConstants, circumferential_stress, longitudinal_stress, wall_tension
from models.laws.resistance import mucus_drag
from models.sets import load_measurement

WALL = WallConstants.from_set()
CAPSULE, TISSUE = Capsule(), Tissue()
SECTION, LENGTH = wall_section(CAPSULE, TISSUE), stretched_length(CAPSULE)
drags = st.floats(1e-7, 5e-3)


@pytest.mark.parametrize("stress", [longitudinal_stress, circumferential_stress])
def test_stress_vanishes_at_rest_and_rises(stress):
    assert stress(1.0, WALL) == 0
    assert np.all(np.diff(stress(np.linspace(1.0, 1.6, 200), WALL)) > 0)
    assert np.all(stress(np.linspace(0.9, 0.999, 50), WALL) < 0)


def test_tangent_modulus_at_rest():
    """From the series about 1: 4 c1 + k1 + 2 kLM1 lengthwise (dI/dl = 1), 4 c1 + k1 + 2 kCM1 around (dI/dl = factor =
    -1).
    """
    h = 1e-6
    along = (longitudinal_stress(1 + h, WALL) - longitudinal_stress(1 - h, WALL)) / (2 * h)
    around = (circumferential_stress(1 + h, WALL) - circumferential_stress(1 - h, WALL)) / (2 * h)
    assert along == pytest.approx(4 * WALL.c1_Pa + 2 * WALL.k1_lm_Pa + WALL.k1_coll_Pa, rel=1e-6)
    assert around == pytest.approx(4 * WALL.c1_Pa + 2 * WALL.k1_cm_Pa + WALL.k1_coll_Pa, rel=1e-6)


@given(drags)
def test_tension_is_odd_and_rises(u):
    tension = wall_tension(u, WALL, SECTION, LENGTH)
    assert wall_tension(-u, WALL, SECTION, LENGTH) == -tension
    assert wall_tension(1.01 * u, WALL, SECTION, LENGTH) > tension > 0


def test_tension_check_values():
    assert wall_tension(0.0, WALL, SECTION, LENGTH) == 0
    assert wall_tension(np.array([0.25e-3, 1e-3]), WALL, SECTION, LENGTH) == pytest.approx(
        [38.2e-3, 163.2e-3], rel=2e-3
    )


def test_wall_takes_the_capsules_shape():
    shoulder = shoulder_position(CAPSULE, TISSUE)
    assert wall_diameter(0.0, CAPSULE, TISSUE) == pytest.approx(relaxed_diameter(CAPSULE, TISSUE))
    x = np.array([shoulder, shoulder + 1e-3, shoulder + CAPSULE.cylinder_length_m])
    assert wall_diameter(x, CAPSULE, TISSUE) == pytest.approx(2 * CAPSULE.radius_m)
    assert shoulder == pytest.approx(CAPSULE.radius_m * math.sqrt(3) / 2)


def test_low_speed_moduli_pass_near_table_1():
    table = load_measurement("viscoelastic_table1_relaxation")
    fitted = low_speed_moduli(table["shear_strain"])
    for name in ("E1", "E2", "E3"):
        assert getattr(fitted, name) == pytest.approx(table[f"{name}_Pa"], rel=0.3)
    assert fitted.eta1 == pytest.approx(table["eta1_Pa_s"], rel=0.2)
    assert fitted.eta2 == pytest.approx(table["eta2_Pa_s"], rel=0.2)


def test_relaxation_falls_from_all_springs_to_the_lone_one():
    moduli = low_speed_moduli(0.5)
    t = np.linspace(0, 10, 400)
    assert moduli.relaxation(0.0) == pytest.approx(moduli.E1 + moduli.E2 + moduli.E3)
    assert moduli.relaxation(1e3) == pytest.approx(moduli.E3)
    assert np.all(np.diff(moduli.relaxation(t)) < 0)


def test_hoop_stress_rises_with_speed_and_vanishes_without_strain():
    speeds = np.array([0.5e-3, 5e-3, 20e-3, 60e-3])
    for moduli in (low_speed_moduli(0.4), high_speed_moduli()):
        assert np.all(np.diff(hoop_stress(0.4, 3e-3, speeds, moduli)) > 0)
        assert np.all(hoop_stress(0.0, 3e-3, speeds, moduli) == 0)


def test_blend_is_a_step_about_20_mm_s():
    speeds = np.array([0.0, 19e-3, 20e-3, 21e-3, 60e-3])
    assert blend_weight(speeds) == pytest.approx([0, 0, 0.5, 1, 1])
    assert np.all(np.diff(blend_weight(np.linspace(18e-3, 22e-3, 100))) >= 0)


@given(st.floats(1e-6, 0.1))
def test_mucus_drag_is_odd_and_thins_under_shear(w):
    film = TISSUE.mucus_thickness_m
    drag = mucus_drag(w, film)
    assert mucus_drag(-w, film) == -drag
    assert 0 < drag < mucus_drag(2 * w, film) < 2 * drag


def test_mucus_drag_at_rest_and_published():
    film = TISSUE.mucus_thickness_m
    assert mucus_drag(0.0, film) == 0
    assert mucus_drag(0.5e-3, film) == pytest.approx(0.73e-3, rel=5e-3)
    assert mucus_drag(10e-3, film) == pytest.approx(2.55e-3, rel=5e-3)
