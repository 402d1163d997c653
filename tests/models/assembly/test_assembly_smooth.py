"""The smooth model that a controller differentiates: finite and right derivatives at rest and on the move."""

import casadi as ca
import numpy as np
import pytest

from models.assembly.model import Assembly, assemble
from models.drives.coil import Coil, VoltageCoil
from models.drives.drive import Drive
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.drives.vibro import Stop, Vibro, VoltageVibro
from models.laws.geometry import Capsule, Tissue
from models.surfaces.gut import Wall
from models.surfaces.surface import Plate
from tests.models.running import Array

GUT, PLATE = Wall.around(Capsule(), Tissue()), Plate(4e-3, 0.29)
DRIVES: tuple[Drive, ...] = (Pull(), Magnetic(), Coil(), VoltageCoil(), Vibro(front=Stop(1e-3, 500.0)), VoltageVibro())
EPS, STEP_S = 1e-4, 1e-3
CASES = [(s, d) for s in (GUT, PLATE) for d in DRIVES if not (d.imposed and isinstance(s, Plate))]
each_case = pytest.mark.parametrize(("surface", "drive"), CASES, ids=lambda x: type(x).__name__)
MOVES = {
    "rest": {},
    "moves": {"v": 5e-3, "u": 1e-4},
    "backward": {"v": -5e-3, "u": -1e-4, "direction": -1.0},
    "draws back": {"v": 5e-3, "u": 1e-4, "slip": 1.0, "u_rate": -5e-3},
    "goes with the wall": {"v": 0.0, "u": 1e-4, "slip": 1.0},
}


def derivatives(model: Assembly) -> ca.Function:
    """Of state and output with respect to state, commands, step and parameters."""
    symbols = model.step.sx_in()
    both = ca.vertcat(*model.step(*symbols))
    return ca.Function("d", symbols, [ca.jacobian(both, symbols[k]) for k in (0, 1, 2, 4, 5)])


def slope(model: Assembly, state: Array, command: float, along: str) -> tuple[float, float]:
    """d(v next)/d(state `along`) as CasADi has it, and by central differences."""
    i, j, q = model.states.index(along), model.states.index("v"), model.vector({})
    exact = float(derivatives(model)(state, command, command, 0.0, STEP_S, q)[0][j, i])
    d = 1e-9
    up, down = (
        float(model.step(state + s * d * np.eye(state.size)[i], command, command, 0.0, STEP_S, q)[0][j])
        for s in (1, -1)
    )
    return exact, (up - down) / (2 * d)


@each_case
@pytest.mark.parametrize("motion", MOVES)
def test_derivatives_are_finite(surface: Wall | Plate, drive: Drive, motion: str) -> None:
    model = assemble(surface, drive, smoothing=EPS)
    start = model.start(**MOVES[motion])
    for command in (0.0, 1e-5 if drive.imposed else 0.1):
        for slopes in derivatives(model)(start, 0.0, command, 0.0, STEP_S, model.vector({})):
            assert np.isfinite(np.array(slopes)).all()


def test_a_resting_capsule_answers_to_force_wall_and_speed() -> None:
    """At exact rest sign and abs have no derivative; the smooth model has the slopes all the same."""
    model = assemble(GUT, Magnetic(), smoothing=EPS)
    for along in ("x", "u", "v"):
        exact, difference = slope(model, model.start(), 0.0, along)
        assert exact != 0
        assert exact == pytest.approx(difference, rel=1e-4)


@pytest.mark.parametrize("motion", ["moves", "backward", "draws back"])
@pytest.mark.parametrize("along", ["x", "u", "v"])
def test_derivatives_are_right_on_the_move(motion: str, along: str) -> None:
    model = assemble(GUT, Magnetic(), smoothing=EPS)
    exact, difference = slope(model, model.start(**MOVES[motion]), 3e-3, along)
    assert exact == pytest.approx(difference, rel=1e-4, abs=1e-7)


def test_the_mucus_film_has_a_finite_slope_where_capsule_and_wall_move_together() -> None:
    """Paper V's drag grows as the slip speed to the power 0.24: an infinite slope at 0, cut off at the smoothing."""
    model = assemble(GUT, Magnetic(), smoothing=EPS)
    q = model.vector({})
    limit = GUT.hold(0.0, {"hoop_stress_factor": 1.0, "friction_coefficient": 0.082})[1]
    back = float(GUT.drag_at(limit)) / GUT.tissue.recovery_time_s
    together = model.start(v=-back, u=1e-4, slip=1.0, u_rate=-back)
    for slopes in derivatives(model)(together, 0.0, 0.0, 0.0, STEP_S, q):
        assert np.isfinite(np.array(slopes)).all()


def test_a_smooth_resting_body_creeps_no_faster_than_its_smoothing() -> None:
    model = assemble(PLATE, Coil(1.0), smoothing=EPS)
    state, q = model.start(), model.vector({})
    for _ in range(200):
        state = np.array(model.step(state, 4e-3, 4e-3, 0.0, STEP_S, q)[0]).ravel()
    weight = 0.29 * 4e-3 * 9.81
    assert state[1] == pytest.approx(EPS * 4e-3 / (weight - 4e-3), rel=1e-3)
