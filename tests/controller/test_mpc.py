"""The MPC in closed loop with its own model and with the plant: bounds, deadline, NaN, offset, warm start, rest."""

from dataclasses import dataclass, replace
from itertools import count

import numpy as np
import pytest

from controller.limits import Envelope, Limits
from controller.model.control_model import ControlModel, control_model
from controller.mpc.mpc import MPC
from controller.signals import Action, Adapted, Estimate
from controller.tuned import Horizon, Weights
from models.theta import Theta
from plant.drives import TrueMagnet
from plant.layout import S_SLIP, S_U, S_V, S_X
from plant.rig import Plant, Truth
from tests.controller.loops import ticked
from tests.controller.model.test_control_model import rig_of
from tests.models.running import Array

TICK_S = 2e-3
PATIENT = Horizon(deadline_s=10.0)
BOUNDS = Envelope(-0.1, 0.1, Limits(speed_m_s=0.1, force_N=0.5), 0.05, 5.0, 0.011)


@dataclass(frozen=True)
class Line:
    """A straight reference that may stop."""

    speed_m_s: float
    until_s: float = np.inf
    start_m: float = 0.0

    def position(self, t: Array) -> Array:
        return self.start_m + self.speed_m_s * np.clip(t, 0.0, self.until_s)

    def speed(self, t: Array) -> Array:
        return np.where((t >= 0) & (t < self.until_s), self.speed_m_s, 0.0)


@dataclass
class Run:
    """What a closed loop went through."""

    x: Array
    command: Array
    actions: list[Action]


@pytest.fixture(scope="module")
def model() -> ControlModel:
    return control_model(rig_of("magnetic"), Theta(), TICK_S)


def closed(
    mpc: MPC, plant: ControlModel, reference: Line, seconds: float, disturbance: float = 0.0, told: float = 0.0
) -> Run:
    """The loop with `plant` as the truth, seen exactly, under a `disturbance` in N of which the MPC is `told`."""
    n = round(seconds / TICK_S)
    x, state = np.zeros(n), plant.initial()
    command, actions = np.zeros(n), []
    mpc.reset(0.0, Estimate(0.0, state, np.zeros(state.size)), 0.0)
    for k in range(n):
        action = mpc.act(k * TICK_S, Estimate(k * TICK_S, state, np.zeros(state.size), told), reference)
        state = ticked(plant.kernels, state, action.command, disturbance, k * TICK_S)
        x[k], command[k] = state[0], action.command
        actions.append(action)
    return Run(x, command, actions)


def error(run: Run, reference: Line, skip: int = 0) -> Array:
    return np.asarray(run.x - reference.position(np.linspace(TICK_S, run.x.size * TICK_S, run.x.size)))[skip:]


def test_it_tracks_through_stick_and_slip(model: ControlModel) -> None:
    """1 mm/s is deep stick and slip: with its own model and state the error stays below a tenth of a tooth (0.3 mm)."""
    run = closed(MPC(model, BOUNDS, horizon=PATIENT), model, Line(1e-3), 1.0)
    assert {a.status for a in run.actions} == {"ok"}
    assert np.sqrt(np.mean(error(run, Line(1e-3)) ** 2)) < 0.03e-3


@pytest.mark.parametrize("hold_s", [0.0, 0.01])
def test_the_hard_bounds_hold_and_the_soft_ones_bend(model: ControlModel, hold_s: float) -> None:
    """A step of 30 mm cannot be tracked: carriage range, rate and acceleration hold exactly, the gap within a
    percent.
    """
    bounds = replace(BOUNDS, high=0.02)
    run = closed(MPC(model, bounds, horizon=replace(PATIENT, hold_s=hold_s)), model, Line(0.0, start_m=0.03), 1.2)
    rate = np.diff(run.command, prepend=0.0) / TICK_S
    assert run.command.max() <= bounds.high + 1e-9
    assert np.abs(rate).max() <= bounds.rate * (1 + 1e-6)
    assert np.abs(np.diff(rate, prepend=0.0)).max() <= bounds.acceleration * TICK_S * (1 + 1e-6)
    assert np.abs(run.command - run.x).max() < bounds.gap_m * 1.01
    assert run.x[-1] > 0.012


def test_a_plan_is_followed_while_the_capsule_goes_along_it(model: ControlModel) -> None:
    """10 ms are five ticks: few plans, no worse than one for each tick; a capsule 0.1 mm off, or a lost estimate, ends
    it at once.
    """
    horizon = replace(PATIENT, hold_s=0.01)
    every, fewer = (closed(MPC(model, BOUNDS, horizon=h), model, Line(1e-3), 1.0) for h in (PATIENT, horizon))
    planned = sum(action.predicted is not None for action in fewer.actions)
    assert all(action.predicted is not None for action in every.actions)
    assert planned < 0.5 * len(fewer.actions)
    rmse = [float(np.sqrt(np.mean(error(run, Line(1e-3)) ** 2))) for run in (every, fewer)]
    assert rmse[1] < 1.2 * rmse[0]
    mpc, state = MPC(model, BOUNDS, horizon=horizon), model.initial()
    mpc.reset(0.0, Estimate(0.0, state, state), 0.0)
    seen = []
    for k in range(60):
        off = 1e-4 if k == 50 else 0.0
        shown = state + np.array([off, 0.0, 0.0, 0.0])
        action = mpc.act(k * TICK_S, Estimate(k * TICK_S, shown, state, 0.0, lost=k == 55), Line(3e-3))
        seen.append((action.status, action.predicted is not None))
        state = ticked(model.kernels, state, action.command, 0.0, k * TICK_S)
    assert seen[50] == ("ok", True)
    assert seen[55] == ("lost", False)
    assert seen[56] == ("ok", True)
    assert ("ok", False) in seen[20:50]


def test_a_bound_on_the_wall_s_force_is_kept(model: ControlModel) -> None:
    """Fast motion presses harder: with a bound of 85 mN the capsule goes more slowly than it could."""

    def pressed(limit: float) -> tuple[float, float]:
        envelope = replace(BOUNDS, limits=replace(BOUNDS.limits, force_N=limit))
        run = closed(MPC(model, envelope, horizon=PATIENT), model, Line(25e-3), 0.6)
        return float(np.max(run.command - run.x)), float(run.x[-1])

    (free_gap, free), (held_gap, held) = pressed(0.5), pressed(0.07)
    assert held_gap < free_gap
    assert held < free


def test_a_known_disturbance_leaves_no_offset(model: ControlModel) -> None:
    blind = closed(MPC(model, BOUNDS, horizon=PATIENT), model, Line(3e-3), 0.6, disturbance=-0.02)
    told = closed(MPC(model, BOUNDS, horizon=PATIENT), model, Line(3e-3), 0.6, disturbance=-0.02, told=-0.02)
    mean = [abs(float(np.mean(error(run, Line(3e-3), 150)))) for run in (blind, told)]
    assert mean[1] < 0.02e-3
    assert mean[0] > 3 * mean[1]


def test_what_the_estimator_learned_is_planned_with(model: ControlModel) -> None:
    """A wall that grips 30 % more: told so by other parameters, the MPC tracks as with a model that is right; nonsense
    is not taken.
    """
    truth = control_model(rig_of("magnetic"), {"hoop_stress_factor": 1.3}, TICK_S)

    def rmse(adapted: Adapted | None) -> float:
        mpc, state, x = MPC(model, BOUNDS, horizon=PATIENT), truth.initial(), np.zeros(300)
        mpc.reset(0.0, Estimate(0.0, state, state), 0.0)
        for k in range(x.size):
            action = mpc.act(k * TICK_S, Estimate(k * TICK_S, state, state, 0.0, False, adapted), Line(3e-3))
            assert action.status == "ok"
            state = ticked(truth.kernels, state, action.command, 0.0, k * TICK_S)
            x[k] = state[0]
        return float(np.sqrt(np.mean((x - 3e-3 * TICK_S * np.arange(1, x.size + 1)) ** 2)))

    unaware, aware = rmse(None), rmse(Adapted(truth.values, 0.0))
    assert aware < 0.5 * unaware
    assert rmse(Adapted(np.full(truth.values.size, np.nan), 0.0)) == unaware


def test_a_hold_has_no_limit_cycle(model: ControlModel) -> None:
    """Move 2 mm, then stay, on the plant with exact friction and 15 % other forces, which a slow observer of the
    disturbance takes up: the carriage stops and stays where it is.
    """
    mpc, plant = MPC(model, BOUNDS, horizon=PATIENT), Plant(Truth(TrueMagnet(25.0, 0.02), hoop_factor=1.15))
    expected, command, force, n = model.initial(), 0.0, 0.0, 2500
    x, commands = np.zeros(n), np.zeros(n)
    mpc.reset(0.0, Estimate(0.0, expected, expected), command)
    for k in range(n):
        state = plant.state[[S_X, S_V, S_U, S_SLIP]]
        force += 20.0 * (state[0] - expected[0])
        action = mpc.act(k * TICK_S, Estimate(k * TICK_S, state, state, force), Line(5e-3, 0.4))
        expected = ticked(model.kernels, state, action.command, force, k * TICK_S)
        plant.advance(np.linspace(command, action.command, round(TICK_S / plant.rig.step_s) + 1))
        x[k], commands[k], command = plant.state[S_X], action.command, action.command
    late = slice(-1000, None)
    assert np.ptp(x[late]) == 0.0
    assert np.ptp(commands[late]) == 0.0
    assert abs(x[-1] - 2e-3) < 2 * PATIENT.rest_m


def test_the_warm_start_helps(model: ControlModel) -> None:
    """One step a tick from the shifted plan is worth more than one from scratch."""

    def worth(forget: bool) -> float:
        mpc, state, total = MPC(model, BOUNDS, horizon=replace(PATIENT, iterations=1)), model.initial(), 0.0
        mpc.reset(0.0, Estimate(0.0, state, state), 0.0)
        command = 0.0
        for k in range(200):
            if forget:
                mpc.reset(k * TICK_S, Estimate(0.0, state, state), command)
            command = mpc.act(k * TICK_S, Estimate(k * TICK_S, state, state), Line(8e-3)).command
            state = ticked(model.kernels, state, command, 0.0, 0.0)
            assert mpc.last is not None
            total += mpc.last.cost
        return total

    assert worth(False) < 0.9 * worth(True)


def test_nan_in_anything_keeps_the_last_command(model: ControlModel) -> None:
    mpc, good = MPC(model, BOUNDS, horizon=PATIENT), model.initial()
    mpc.reset(0.0, Estimate(0.0, good, good), 0.0)
    before = mpc.act(0.0, Estimate(0.0, good, good), Line(5e-3)).command
    assert before != 0
    bad = good.copy()
    bad[1] = np.nan
    for now, state, force, reference in (
        (TICK_S, bad, 0.0, Line(5e-3)),
        (TICK_S, good, np.inf, Line(5e-3)),
        (np.nan, good, 0.0, Line(5e-3)),
        (TICK_S, good, 0.0, Line(np.nan)),
        (TICK_S, good[:2], 0.0, Line(5e-3)),
        (TICK_S, good * 0 + 1e300, 0.0, Line(5e-3)),
    ):
        action = mpc.act(now, Estimate(now, state, state, force), reference)
        assert (action.status, action.command) == ("failed", before)
    assert mpc.act(TICK_S, Estimate(TICK_S, good, good, 0.0, lost=True), Line(5e-3)).status == "lost"
    after = mpc.act(TICK_S, Estimate(TICK_S, good, good), Line(5e-3))
    assert after.status == "ok"
    assert abs(after.command - before) <= BOUNDS.rate * TICK_S


def test_the_deadline_cuts_the_steps_short(model: ControlModel) -> None:
    """A clock that goes on by 1 ms each time it is read: no step is begun that would end beyond the deadline, by
    count.
    """

    def iterations(deadline_s: float) -> tuple[int, str]:
        ticking = count()
        mpc = MPC(
            model, BOUNDS, horizon=Horizon(deadline_s=deadline_s, iterations=2), clock=lambda: 1e-3 * next(ticking)
        )
        mpc.reset(0.0, Estimate(0.0, model.initial(), model.initial()), 0.0)
        action = mpc.act(0.0, Estimate(0.0, model.initial(), model.initial()), Line(0.0, start_m=0.5e-3))
        assert mpc.last is not None
        assert np.isfinite(action.command)
        return mpc.last.iterations, action.status

    assert iterations(1.0) == (2, "ok")
    assert iterations(8e-3) == (1, "ok")
    assert iterations(0.5e-3) == (0, "late")


def test_a_coil_is_led_by_its_voltage() -> None:
    model = control_model(rig_of("coil"), Theta(), TICK_S, driven="coil_voltage_V")
    run = closed(MPC(model, horizon=PATIENT, weights=Weights()), model, Line(5e-3), 0.3)
    assert {a.status for a in run.actions} == {"ok"}
    assert np.sqrt(np.mean(error(run, Line(5e-3), 50) ** 2)) < 0.1e-3


def test_what_it_cannot_lead_is_refused() -> None:
    with pytest.raises(ValueError, match="magnetic or coil"):
        MPC(control_model(rig_of("vibro"), Theta(), TICK_S))
    with pytest.raises(ValueError, match="stages must lie"):
        Horizon(stages=0)
    with pytest.raises(ValueError, match="hold_s must lie"):
        Horizon(hold_s=0.2)
    with pytest.raises(ValueError, match="weight gap"):
        Weights(gap=0.0)


def test_a_plan_that_expects_slip_late_does_not_ease_off_before_it(model: ControlModel) -> None:
    state = model.initial(0.0, 2e-3)
    state[model.index("v")], state[model.index("u")] = 1e-3, 2.3e-4
    estimate = Estimate(0.0, state, np.full(state.size, 1e-5))
    pulls = []
    for late in (0.0, 0.25):
        mpc = MPC(model, horizon=Horizon(late_slip=late))
        mpc.reset(0.0, estimate, 2e-3)
        mpc.act(0.0, estimate, Line(1e-3))
        assert mpc.last is not None
        pulls.append(mpc.last.commands - mpc.last.path[:, 0])
    assert pulls[1].max() > 1.02 * pulls[0].max()
