"""Each law is one text: NumPy arrays and CasADi symbols give the same numbers."""

import casadi as ca
import numpy as np
import pytest

from models.laws.five_elements import (
    blend_weight,
    five_element_modulus,
    high_speed_moduli,
    hoop_stress,
    low_speed_moduli,
    springpot_modulus,
)
from models.laws.flat_car import FlatCar
from models.laws.geometry import Capsule, Tissue, wall_diameter
from models.laws.hyperelastic import WallConstants, circumferential_stress, longitudinal_stress, wall_tension
from models.laws.resistance import (
    contact_pressure,
    environmental_resistance,
    mucus_drag,
    normal_load,
    sliding_resistance,
)
from models.laws.stick_slip import elastic_pressure, friction_curve, printed_force, printed_tension, stick_slip_tooth

WALL, CAPSULE, TISSUE, CAR = WallConstants.from_set(), Capsule(), Tissue(), FlatCar.from_set()
TOOTH = stick_slip_tooth(printed_tension(26.5e-3), 16.56e-3, 0.5e-3, 0.6e-3)

LAWS = {
    "longitudinal": (lambda x: longitudinal_stress(x, WALL), (1.0, 1.5)),
    "circumferential": (lambda x: circumferential_stress(x, WALL), (0.9, 1.5)),
    "tension": (lambda x: wall_tension(x, WALL, 1e-4, 26.5e-3), (-1e-3, 1e-3)),
    "diameter": (lambda x: wall_diameter(x, CAPSULE, TISSUE), (0.0, 20e-3)),
    "moduli": (lambda x: low_speed_moduli(x).relaxation(0.1), (0.0, 1.0)),
    "hoop": (lambda x: hoop_stress(0.4, 2e-3, x, high_speed_moduli()), (1e-4, 60e-3)),
    "blend": (blend_weight, (18e-3, 22e-3)),
    "mucus": (lambda x: mucus_drag(x, 30e-6), (-20e-3, 20e-3)),
    "pressure": (lambda x: contact_pressure(x, 5e-3, CAPSULE, TISSUE), (1e-4, 20e-3)),
    "elastic pressure": (lambda x: elastic_pressure(x, CAPSULE, TISSUE, WALL), (7e-3, 13e-3)),
    "environmental low": (lambda x: environmental_resistance(x, CAPSULE, TISSUE), (-20e-3, 20e-3)),
    "environmental blend": (lambda x: environmental_resistance(x, CAPSULE, Tissue(regime="blend")), (15e-3, 25e-3)),
    "load high": (lambda x: normal_load(x, CAPSULE, Tissue(regime="high")), (1e-3, 60e-3)),
    "total": (lambda x: sliding_resistance(x, CAPSULE, TISSUE).total, (1e-4, 60e-3)),
    "printed": (printed_force, (1.0, 1.01)),
    "saw": (lambda x: friction_curve(x, printed_tension(26.5e-3), TOOTH, 23.23e-3), (0.0, 0.3)),
    "flat car": (CAR.spring_force, (0.0, 0.2)),
    "storage": (lambda x: five_element_modulus(x, low_speed_moduli(0.5)).storage, (1.0, 400.0)),
    "loss": (lambda x: five_element_modulus(x, low_speed_moduli(0.5)).loss, (1.0, 400.0)),
    "springpot": (lambda x: springpot_modulus(x, 10.0, 20.0, 0.4).loss, (1.0, 400.0)),
}


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
@pytest.mark.parametrize("name", LAWS)
def test_numpy_and_casadi_agree(name, kind):
    law, (low, high) = LAWS[name]
    grid = np.linspace(low, high, 23)
    symbol = kind.sym("x")
    symbolic = ca.Function("law", [symbol], [law(symbol)])
    assert np.array([float(symbolic(x)) for x in grid]) == pytest.approx(np.asarray(law(grid)), rel=1e-10, abs=1e-15)


@pytest.mark.parametrize("name", ["tension", "mucus", "environmental low", "saw"])
def test_column_of_symbols(name):
    law, (low, high) = LAWS[name]
    grid = np.linspace(low, high, 5)
    symbol = ca.SX.sym("x", 5)
    assert np.array(ca.Function("law", [symbol], [law(symbol)])(grid)).ravel() == pytest.approx(
        np.asarray(law(grid)), rel=1e-10
    )


def test_derivative_of_the_resistance():
    v = ca.SX.sym("v")
    slope = ca.Function("slope", [v], [ca.gradient(environmental_resistance(v, CAPSULE, TISSUE), v)])
    h = 1e-6
    ends = environmental_resistance(np.array([5e-3 - h, 5e-3 + h]), CAPSULE, TISSUE)
    assert float(slope(5e-3)) == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=1e-5)
