"""The controller in C answers as the one in Python on the same estimates, and estimates alike on the same readings."""

import ctypes
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from controller.drives import envelope_of
from controller.estimator.particle_filter import ParticleEstimator
from controller.reference import Trajectory, by_speeds, through
from controller.registry import estimator_for
from controller.signals import Measurement
from controller.step.compiled import CompiledEstimator, compiled, supervisor_of
from controller.step.library import Out, memory, pointer_to
from controller.step.numbers import numbers_of
from hil.app.scenario.scenario import load_track_scenario
from hil.app.track.loop import believed_model
from models.theta import Theta
from plant.drives import TrueCoil, TrueMagnet
from plant.rig import Truth
from tests.controller.loops import model_of
from tests.controller.step.loops import both, needs_compiler
from tests.places import SCENARIOS

pytestmark = needs_compiler
TRUTH = {"magnetic": Truth(TrueMagnet(24.2), hoop_factor=1.09), "coil": Truth(TrueCoil(), hoop_factor=1.05)}
FAR: Trajectory = through((4e-3, 1e-3), 0.02, 0.05, 0.15)
SLOW: Trajectory = by_speeds([0.0, 1e-3], [0.15, 1.0])


@pytest.mark.parametrize("kind", ["magnetic", "coil"])
@pytest.mark.parametrize(("controller", "reference"), [("feedforward", FAR), ("mpc", FAR), ("mpc", SLOW)])
def test_the_commands_are_those_of_python(kind: str, controller: str, reference: Trajectory) -> None:
    """The same arithmetic in another order, and another set-up of the same solver: rounding alone differs."""
    model = model_of(kind)
    run = both(model, controller, TRUTH[kind], reference, 500)
    envelope = envelope_of(model.drive)
    assert np.ptp(run.commands[:, 0]) > 1e-3 * (envelope.high - envelope.low)
    assert np.max(np.abs(run.commands[:, 0] - run.commands[:, 1])) < 1e-6 * (envelope.high - envelope.low)
    assert all(first == second for first, second in run.statuses)
    assert [e.reason for e in run.supervisors[0].events] == [e.reason for e in run.supervisors[1].events]


@pytest.mark.parametrize("kind", ["magnetic", "coil"])
def test_the_estimates_are_alike(kind: str) -> None:
    """Another sequence of random numbers: both are as near to each other as their own standard deviations say."""
    run = both(model_of(kind), "feedforward", TRUTH[kind], FAR, 600)
    known = [(p, c) for p, c in run.estimates if not p.lost]
    off = np.array([p.state[0] - c.state[0] for p, c in known])
    std = np.array([[p.std[0], c.std[0]] for p, c in known])
    assert [p.lost for p, _ in run.estimates] == [c.lost for _, c in run.estimates]
    assert np.sqrt(np.mean(off**2)) < np.mean(std)
    assert 0.7 < np.mean(std[:, 1]) / np.mean(std[:, 0]) < 1.4


def test_an_inner_mass_is_led_as_by_python() -> None:
    """Its drive map is a table; forth, a rest, and back in another gear."""
    scenario = load_track_scenario(SCENARIOS / "track_vibro_gut.toml")
    reference = through((6e-3, -2e-3), 8e-3, 0.3, 0.5)
    run = both(believed_model(scenario, Theta()), "vibro_square", scenario.truth, reference, 3000)
    assert np.ptp(run.commands[:, 0]) > 0.1
    assert np.max(np.abs(run.commands[:, 0] - run.commands[:, 1])) < 1e-9
    assert all(first == second for first, second in run.statuses)


def test_without_readings_both_stop_alike() -> None:
    """A coil's current ramps to 0."""
    run = both(model_of("coil"), "feedforward", TRUTH["coil"], FAR, 600, cut=300)
    assert run.statuses[-1] == ("lost", "lost")
    assert np.max(np.abs(run.commands[:, 0] - run.commands[:, 1])) < 1e-6
    assert run.commands[-1, 1] == 0


def taken(estimator: ParticleEstimator | CompiledEstimator, tick_s: float) -> object:
    """What an estimator counts of good, late, unreadable and false readings, and after a real jump."""
    for k in range(400):
        now = k * tick_s
        place = 5e-3 if k >= 200 else 0.0
        arrived = [Measurement("position_m", place, now)] if k % 5 == 0 else []
        if k == 100:
            arrived = [
                Measurement("position_m", 0.0, now - 0.05),
                Measurement("position_m", 0.0, now - 10.0),
                Measurement("position_m", 0.0, now + 1.0),
                Measurement("position_m", math.nan, now),
                Measurement("position_m", 0.0, math.nan),
                Measurement("position_m", 0.04, now),
                Measurement("temperature_C", 20.0, now),
                Measurement("carriage_position_m", 1e-3, now),
            ]
        estimator.observe(now, 0.0, arrived)
    return estimator.counts


def test_bad_readings_are_counted_alike() -> None:
    model = model_of()
    envelope = envelope_of(model.drive)
    python = estimator_for("feedforward", model)
    in_c = supervisor_of("feedforward", model, envelope).observer_for("feedforward", model, "default")
    assert isinstance(python, ParticleEstimator)
    assert isinstance(in_c, CompiledEstimator)
    assert taken(python, model.tick_s) == taken(in_c, model.tick_s)
    assert python.offset == in_c.offset


def test_an_unreadable_estimate_stops_the_drive_and_raises_nothing() -> None:
    model = model_of()
    in_c = supervisor_of("feedforward", model, envelope_of(model.drive))
    nothing: Any = None
    action = in_c.act(0.0, nothing, nothing)
    assert action.command == in_c.issued.command == 0.0
    assert in_c.active == "stop"


def test_bounds_of_the_call_lead_a_command_and_let_a_stop_end_at_rest() -> None:
    """The least command is a push that the controller did not ask for; a stop goes to 0 all the same."""
    model = model_of("coil")
    run = both(model, "feedforward", TRUTH["coil"], FAR, 300)
    for supervisor, estimate in zip(run.supervisors, run.estimates[-1], strict=True):
        for room in ((0.3, 0.3), (-0.05, -0.01)):
            supervisor.room = room
            for k in range(300, 304):
                command = supervisor.act(k * model.tick_s, replace(estimate, time_s=k * model.tick_s), FAR).command
            assert room[0] <= command <= room[1]
        supervisor.halt("asked")
        for k in range(304, 450):
            command = supervisor.act(k * model.tick_s, estimate, FAR).command
        assert command == 0


def test_a_copied_state_goes_on_to_the_last_bit() -> None:
    """One function over one state of fixed size: a copy of the memory is a copy of the controller."""
    model = model_of()
    found = compiled("mpc", model, envelope_of(model.drive))
    assert found is not None
    library, given = found.library, found.library.In()
    given.least, given.most, given.temperature_C, given.in_force = -math.inf, math.inf, 20.0, math.nan
    state, answers = memory(library.state), [Out(), Out()]
    library.functions.capsule_init(
        ctypes.byref(state), pointer_to(found.numbers), ctypes.c_double(0.0), ctypes.c_double(0.0)
    )
    copy = memory(library.state)
    for k in range(300):
        given.time_s, given.readings = k * model.tick_s, int(k % 5 == 0)
        given.reading[0].stamp_s, given.reading[0].value = given.time_s, 1e-4 * math.sin(0.1 * k)
        given.position_m[:] = [1e-3] * len(given.position_m)
        if k == 200:
            ctypes.memmove(copy, state, ctypes.sizeof(state))
        for one, out in zip((state, copy) if k >= 200 else (state,), answers, strict=False):
            library.functions.capsule_step(ctypes.byref(one), ctypes.byref(given), ctypes.byref(out))
    assert bytes(answers[0]) == bytes(answers[1])
    assert answers[0].active == 0
    assert answers[0].command != 0


def test_a_reference_that_raises_stops_the_drive() -> None:
    class Raises:
        def position(self, t: object) -> None:
            raise OSError

        speed = position

    model = model_of("coil")
    run = both(model, "feedforward", TRUTH["coil"], FAR, 300)
    supervisor = run.supervisors[1]
    action = supervisor.act(0.3, run.estimates[-1][1], Raises())  # type: ignore[arg-type]
    assert action.status == "stopped"
    assert math.isfinite(action.command)


def test_only_some_controllers_are_written_in_c() -> None:
    model = model_of()
    envelope = envelope_of(model.drive)
    assert compiled("lqr", model, envelope) is None
    with pytest.raises(ValueError, match=r"controller must be one of mpc, feedforward.*got 'lqr'"):
        numbers_of("lqr", model, envelope)
