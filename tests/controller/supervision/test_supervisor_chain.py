"""The supervisor with real controllers on the model with set-valued friction: failed solves and a second without
localisation.
"""

import math
import tomllib
from dataclasses import dataclass

import numpy as np
import pytest

from controller.baselines import LQR, PID
from controller.design.study import LoopRun, simulate
from controller.drives import envelope_of
from controller.model.control_model import ControlModel, control_model
from controller.signals import Action, Array, Estimate, Reference
from controller.supervision.supervisor import Supervisor
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.conftest import RIG

COIL = RIG.replace("magnet_stiffness_N_per_m = 25.0\nmagnet_range_m = 0.02", "force_constant_N_per_A = 0.5").replace(
    'kind = "magnetic"', 'kind = "coil"'
)
TICK, SPEED = 0.002, 1e-3
FAILING, BLIND = (2.0, 2.5), (4.0, 5.0)


class Failing(LQR):
    """An LQR whose solver dies for half a second, now and then with a number that is none."""

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        if FAILING[0] <= now < FAILING[1]:
            if round(now / TICK) % 2:
                raise ArithmeticError("no solution")
            return Action(math.nan)
        return super().act(now, estimate, reference)


@dataclass
class Moving:
    """A reference at `place` that moves at `rate` from the time `since` on."""

    place: float
    rate: float
    since: float

    def position(self, t: Array) -> Array:
        return self.place + self.rate * (t - self.since)

    def speed(self, t: Array) -> Array:
        return np.full_like(t, self.rate)


def run(model: ControlModel) -> tuple[LoopRun, Supervisor]:
    envelope = envelope_of(model.drive)
    supervisor = Supervisor([Failing(model, envelope), PID(model, envelope)], envelope)
    supervisor.reset(0.0, Estimate(0.0, model.initial(), np.zeros(4)), 0.0)

    def law(t: float, state: Array, r: float, speed: float) -> float:
        blind = BLIND[0] <= t < BLIND[1]
        believed = Estimate(t, state * math.nan if blind else state, np.zeros(4), 0.0, lost=False)
        return supervisor.act(t, believed, Moving(r, speed, t)).command

    return simulate(model, law, SPEED, 8.0, 1.0, 0.0), supervisor


@pytest.mark.parametrize("text", [RIG, COIL], ids=["magnetic", "coil"])
def test_failures_are_bridged_without_a_jump_and_tracking_comes_back(text: str) -> None:
    model = control_model(parse_rig(tomllib.loads(text)), Theta(), TICK)
    done, supervisor = run(model)
    error, magnetic = np.abs(done.position - done.reference), model.drive.name == "magnetic"
    names = [event.after for event in supervisor.events]
    assert names[:2] == ["lqr", "pid"]
    assert "stop" in names
    assert supervisor.active == "lqr"
    during = (done.t > FAILING[0]) & (done.t < FAILING[1] + 0.2)
    assert np.max(error[during]) < 1e-3
    blind = (done.t > BLIND[0] + 0.03) & (done.t < BLIND[1])
    assert np.ptp(done.command[blind]) == 0
    assert np.max(np.abs(np.diff(done.position[blind]))) < 1e-6
    if not magnetic:
        assert np.all(done.command[blind] == 0)
    after = done.t > BLIND[1] + 1.0
    assert np.max(error[after]) < 1e-3
    back = (done.t >= BLIND[1]) & (done.t < BLIND[1] + 0.2)
    jump = np.max(np.abs(np.diff(done.command[back])))
    assert jump <= (0.25 * TICK if magnetic else 0.05)


def test_a_whole_run_keeps_every_limit() -> None:
    model = control_model(parse_rig(tomllib.loads(RIG)), Theta(), TICK)
    done, supervisor = run(model)
    speed = np.diff(done.command) / TICK
    limits = supervisor.envelope.limits
    assert np.max(np.abs(speed)) <= limits.carriage_speed_m_s * (1 + 1e-9)
    assert np.max(np.abs(np.diff(speed))) <= limits.carriage_acceleration_m_s2 * TICK * (1 + 1e-6)
    assert np.max(np.abs(done.command - done.position)) <= supervisor.envelope.gap_m + 1e-9
