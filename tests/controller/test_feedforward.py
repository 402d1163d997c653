"""Inverting the model: the inverse's command does what was asked for, on the stable branch; and the compensator in the
loop.
"""

import math

import numpy as np
import pytest

from controller.baselines import PID
from controller.drives import envelope_of
from controller.estimator.cubature import CubatureEstimator
from controller.feedforward import Inverse
from controller.model.control_model import control_model, mean_friction
from controller.reference import STEP_S, Trajectory, by_speeds, through
from controller.registry import CONTROLLERS, build, leads
from controller.signals import Array, Estimate
from controller.tuned import PidGains
from models.theta import Theta
from plant import layout as at
from plant.drives import TrueMagnet
from plant.rig import Truth
from plant.sensing import Instrument
from plant.session import Instruments
from tests.controller.loops import believed, closed_loop, model_of, ticked

MODEL = model_of()
ENVELOPE = envelope_of(MODEL.drive)


@pytest.mark.parametrize("speed", [1e-3, -2e-3, 10e-3])
@pytest.mark.parametrize("slip", [0.0, 1.0])
def test_the_inverse_inverts(speed: float, slip: float) -> None:
    """In stick and in slip, either way, the model under the answer reaches the speed."""
    inverse = Inverse(MODEL, ENVELOPE)
    x = inverse.model.initial(0.01)
    x[MODEL.index("u")], x[MODEL.index("slip")], x[1] = 1e-4, slip, speed
    command = inverse.command(x, 2e-3, speed, 0.0)
    assert abs(command - x[0]) < ENVELOPE.gap_m
    assert ticked(inverse.model.kernels, x, command, 2e-3, 0.0)[1] == pytest.approx(speed, rel=0.05)


def test_the_inverse_of_too_much_is_the_end_of_the_range() -> None:
    """A force that the magnet does not have: the largest gap, not beyond it; no number in, no number out."""
    inverse = Inverse(MODEL, ENVELOPE)
    x = inverse.model.initial(0.0)
    assert inverse.command(x, -10.0, 5e-3, 0.0) == pytest.approx(ENVELOPE.gap_m)
    assert math.isnan(inverse.command(x * math.nan, 0.0, 1e-3, 0.0))


def test_at_rest_the_drive_pulls_against_the_wall_alone() -> None:
    """Holding with the wall dragged by 0.1 mm takes its tension and nothing of friction."""
    inverse = Inverse(MODEL, ENVELOPE)
    x = inverse.model.initial(0.0)
    x[MODEL.index("u")] = 1e-4
    gap = inverse.command(x, 0.0, 0.0, 0.0)
    tension = float(MODEL.symbols.wall_force(x, 0.0, MODEL.values))
    assert 25.0 * gap / (1 + (gap / 0.02) ** 2) ** 2 == pytest.approx(tension, rel=0.05)


def tracked(
    name: str, reference: Trajectory, duration_s: float, instruments: Instruments | None = None
) -> tuple[Array, Array, list[str]]:
    """Rows of the truth, commands and statuses of a run on a rig that is 10 % off."""
    truth = Truth(TrueMagnet(24.0), hoop_factor=1.1)
    estimator = CubatureEstimator(MODEL.sharp)
    return closed_loop(MODEL, build(name, MODEL, ENVELOPE), reference, duration_s, truth, estimator, instruments)[:3]


def test_feedforward_tracks_a_slow_traverse() -> None:
    """At 1 mm/s, deep in stick and slip, within 0.2 mm rms; the sensor's noise is 0.5 mm and a tooth of the wall 0.35
    mm.
    """
    reference = by_speeds([0.0, 1e-3], [0.5, 6.0])
    rows, _, _ = tracked("feedforward", reference, 6.0)
    judged = rows[:, at.O_T] > 1.0
    assert np.sqrt(np.mean((rows[:, at.O_X] - reference.position(rows[:, at.O_T]))[judged] ** 2)) < 0.2e-3


def test_a_lagging_drive_is_not_driven_from_end_to_end() -> None:
    """A lag of 0.1 s turned round within a tick would ask for a hundred times the path."""
    model = control_model(believed(), Theta.of({("actuator_lag", "time_s"): 0.11}), 1e-3)
    assert model.response_s == 0.11
    truth = Truth(TrueMagnet(), hidden={"actuator_lag": {"time_s": 0.1}})
    reference = by_speeds([0.0, 2e-3], [0.5, 5.0])
    chain = build("feedforward", model, envelope_of(model.drive))
    rows, *_ = closed_loop(model, chain, reference, 5.0, truth, CubatureEstimator(model.sharp))
    judged = rows[:, at.O_T] > 2.0
    assert np.sqrt(np.mean((rows[:, at.O_X] - reference.position(rows[:, at.O_T]))[judged] ** 2)) < 0.5e-3


def test_a_held_capsule_rests() -> None:
    """After a move the capsule stays where it is: no limit cycle, no creep, whatever the noise."""
    rows, _, _ = tracked("feedforward", through([3e-3], 2e-3, 0.0, 0.5), 8.0)
    held = rows[rows[:, at.O_T] > 3.0]
    assert np.ptp(held[:, at.O_X]) < 0.1e-3
    assert np.mean(held[:, at.O_V] != 0.0) < 0.02
    assert abs(held[-1, at.O_X] - 3e-3) < 0.5e-3


def test_a_gap_stops_the_drive_and_tracking_comes_back_without_a_jump() -> None:
    """A second without positions: the carriage rests, then goes on within its own limits."""
    gone = Instruments(localisation=Instrument(gaps_s=(2.0, 1.0)))
    rows, commands, statuses = tracked("feedforward", by_speeds([0.0, 1e-3], [0.5, 6.0]), 6.0, gone)
    assert set(statuses[2200:2990]) == {"lost"}
    assert np.ptp(commands[2250:2990]) < 1e-9
    assert np.abs(np.diff(commands)).max() <= ENVELOPE.rate * MODEL.tick_s * (1 + 1e-9)
    late = rows[rows[:, at.O_T] > 5.0]
    assert np.abs(late[:, at.O_X] - 1e-3 * (late[:, at.O_T] - 0.5)).max() < 1e-3


@pytest.mark.parametrize("name", [name for name in CONTROLLERS if "magnetic" in leads(name)])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_no_controller_passes_on_what_is_no_number(name: str, bad: float) -> None:
    """A NaN in the estimate is a status, never a command nor an exception."""
    controller = build(name, MODEL, ENVELOPE)[0]
    state = np.full(len(MODEL.states), bad)
    estimate = Estimate(0.0, state, state, bad)
    controller.reset(0.0, estimate, 0.0)
    action = controller.act(0.0, estimate, by_speeds([1e-3], [1.0]))
    assert action.status in ("failed", "lost")


def test_pid_takes_over_without_a_bump() -> None:
    """The first answer after a reset is the command in force."""
    for friction in (0.0, mean_friction(MODEL)):
        pid = PID(MODEL, ENVELOPE, friction_N=friction)
        estimate = Estimate(0.0, MODEL.initial(1e-3), MODEL.initial(1e-3))
        pid.reset(0.0, estimate, 4e-3)
        answer = pid.act(0.0, estimate, by_speeds([1e-3], [1.0], start_m=1e-3)).command
        assert answer == pytest.approx(4e-3, abs=1e-5)


def test_choices_refuse_what_they_cannot_lead() -> None:
    """An unknown name brings the nearest one, a gain without sense its rule."""
    with pytest.raises(ValueError, match="feedforward"):
        build("feedforwrd", MODEL, ENVELOPE)
    with pytest.raises(ValueError, match="k_p"):
        PidGains(-1.0, 0.0, 0.0)


def test_a_trajectory_is_its_speeds_summed() -> None:
    """Positions are the integral of speeds; it ends at rest where it was sent."""
    path = through([4e-3, 1e-3], 2e-3, 0.5, 0.2)
    t = STEP_S * np.arange(path.positions.size - 1)
    assert np.cumsum(path.speed(t)) * STEP_S == pytest.approx(path.position(t + STEP_S), abs=1e-12)
    assert path.position(np.array([100.0]))[0] == pytest.approx(1e-3, abs=1e-9)
    assert path.speed(np.array([-1.0, 100.0])) == pytest.approx([0.0, 0.0])


def test_friction_that_falls_with_speed_is_broken_loose_from() -> None:
    """Resting friction three quarters above the one in motion, believed a tenth too low: what keeps up the motion would
    never begin it.
    """
    model = control_model(
        believed(),
        Theta.of({("stribeck", "excess"): 0.7, ("stribeck", "speed_m_s"): 2.5e-3, "friction_coefficient": 0.074}),
        1e-3,
    )
    truth = Truth(TrueMagnet(), hidden={"stribeck": {"excess": 0.75, "speed_m_s": 2e-3}})
    reference = by_speeds([0.0, 2e-3], [0.5, 5.0])
    chain = build("feedforward", model, envelope_of(model.drive))[:1]
    rows, *_ = closed_loop(model, chain, reference, 5.0, truth, CubatureEstimator(model.sharp))
    assert rows[-1, at.O_X] == pytest.approx(9e-3, abs=3e-3)
