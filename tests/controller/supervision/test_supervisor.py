"""The supervisor: whatever the controllers below it do, a safe command leaves, without a step, and the best working one
is in charge.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from controller.drives import envelope_of
from controller.signals import Action, Estimate
from controller.supervision.fallback import Rules
from controller.supervision.supervisor import Supervisor
from models.drives.coil import Coil
from models.drives.magnetic import Magnetic
from models.drives.vibro import Vibro
from tests.controller.supervision.supervisor_stubs import DT, Ramp, Stub, estimate, magnetic, raises, run, steady


def test_the_first_controller_is_in_charge_while_it_works() -> None:
    best, second = steady("mpc", 1e-3), steady("pid", 2e-3)
    supervisor = magnetic(best, second)
    actions = run(supervisor, 500)
    assert supervisor.active == "mpc"
    assert actions[-1].command == pytest.approx(1e-3)
    assert actions[-1].status == "ok"
    assert second.asked == 0


@pytest.mark.parametrize(
    "answer",
    [
        raises,
        lambda now: Action(math.nan),
        lambda now: Action(math.inf),
        lambda now: Action(1e-3, "failed"),
        lambda now: Action(1e-3, "lost"),
        lambda now: Action(1e-3, "stopped"),
        lambda now: None,
        lambda now: Action("1"),  # type: ignore[arg-type]
    ],
)
def test_a_controller_that_fails_is_replaced_in_the_same_tick(answer: Callable[[float], Any]) -> None:
    best, second = Stub("mpc", answer), steady("pid", 0.0)
    supervisor = magnetic(best, second)
    first = supervisor.act(DT, estimate(DT), Ramp(1e-3))
    assert supervisor.active == "pid"
    assert second.asked == 1
    assert first.command == 0.0
    assert first.status == "failed"


def test_with_nobody_left_the_carriage_comes_to_rest_where_it_is() -> None:
    best = Stub("mpc", lambda now: Action(0.05 * now) if now < 0.1 else raises(now))
    supervisor = magnetic(best, rules=Rules(retry_s=10.0, retry_longest_s=10.0))
    run(supervisor, 50)
    where = supervisor.issued.command
    actions = run(supervisor, 100, start=50)
    assert supervisor.active == "stop"
    assert actions[-1].status == "stopped"
    assert abs(actions[-1].command - where) < 0.05**2 / 20 + 0.05 * DT + 1e-6
    assert len({action.command for action in actions[20:]}) == 1


def test_with_nobody_left_a_current_is_ramped_down() -> None:
    supervisor = Supervisor([Stub("mpc", raises)], envelope_of(Coil()), Rules(stop_s=0.1))
    supervisor.reset(0.0, estimate(0.0), 0.5)
    commands = [action.command for action in run(supervisor, 60, start=1)]
    assert max(np.abs(np.diff([0.5, *commands]))) <= 0.5 * DT / 0.1 + 1e-12
    assert commands[-1] == 0.0


def test_a_lost_estimate_stops_the_drive_at_once_and_control_comes_back_without_a_step() -> None:
    for drive in (Coil(), Magnetic()):
        supervisor = Supervisor(
            [steady("mpc", 0.3 if drive.name == "coil" else 5e-3)], envelope_of(drive), Rules(blend_s=0.2)
        )
        supervisor.reset(0.0, estimate(0.0), 0.0)
        run(supervisor, 300)
        full = supervisor.issued.command
        lost = run(supervisor, 500, start=300, believed=lambda t: estimate(t, lost=True))
        assert lost[0].status == "lost"
        assert lost[0].command == (0.0 if drive.name == "coil" else full)
        back = [action.command for action in run(supervisor, 300, start=800)]
        assert max(np.abs(np.diff([lost[-1].command, *back]))) <= abs(full) * DT / 0.2 + 1e-9
        assert back[-1] == pytest.approx(full)


@pytest.mark.parametrize(
    "bad",
    [
        lambda t: Estimate(t, np.array([math.nan, 0.0]), np.zeros(2)),
        lambda t: Estimate(t, np.array([0.0, math.inf]), np.zeros(2)),
        lambda t: Estimate(t - 1.0, np.zeros(2), np.zeros(2)),
        lambda t: Estimate(t + 1.0, np.zeros(2), np.zeros(2)),
        lambda t: Estimate(math.nan, np.zeros(2), np.zeros(2)),
        lambda t: Estimate(t, np.zeros(0), np.zeros(0)),
        lambda t: None,
    ],
)
def test_an_estimate_that_cannot_be_believed_is_a_lost_one(bad: Callable[[float], Any]) -> None:
    supervisor = magnetic(steady("mpc", 1e-3))
    run(supervisor, 200)
    held = supervisor.issued.command
    action = run(supervisor, 1, start=200, believed=bad)[0]
    assert action.status == "lost"
    assert action.command == pytest.approx(held, abs=1e-9)


def test_late_answers_are_used_until_there_are_too_many() -> None:
    best, second = Stub("mpc", lambda now: Action(0.0, "late" if now >= 0.1 else "ok")), steady("pid", 0.0)
    supervisor = magnetic(best, second, rules=Rules(late_allowed=2))
    run(supervisor, 50)
    names = [(run(supervisor, 1, start=50 + i)[0].status, supervisor.active) for i in range(4)]
    assert names == [("late", "mpc"), ("late", "mpc"), ("late", "pid"), ("ok", "pid")]


def test_whoever_takes_over_may_be_late_too() -> None:
    chain = [Stub(name, lambda now: Action(0.0, "late")) for name in ("mpc", "pid")]
    supervisor = magnetic(*chain, rules=Rules(late_allowed=2, retry_s=10.0, retry_longest_s=10.0))
    run(supervisor, 3)
    assert [(run(supervisor, 1, start=3 + i), supervisor.active)[1] for i in range(3)] == ["pid", "stop", "stop"]


def test_control_waits_until_the_estimate_has_been_good_for_a_while() -> None:
    supervisor = magnetic(steady("mpc", 1e-3), rules=Rules(settle_s=0.05))
    run(supervisor, 10, believed=lambda t: estimate(t, lost=True))
    statuses = [action.status for action in run(supervisor, 30, start=10)]
    assert statuses.index("ok" if "ok" in statuses else "limited") == pytest.approx(0.05 / DT, abs=1.1)


def test_an_answer_that_took_too_long_is_late() -> None:
    ticking = iter(np.arange(0.0, 1e6, 0.5))
    chain = [steady("mpc", 0.0)]
    supervisor = Supervisor(chain, envelope_of(Magnetic()), Rules(deadline_s=0.1), clock=lambda: float(next(ticking)))
    supervisor.reset(0.0, estimate(0.0), 0.0)
    assert run(supervisor, 1)[0].status == "late"


def test_a_failed_controller_is_tried_again_ever_more_rarely_and_comes_back() -> None:
    best, second = Stub("mpc", lambda now: raises(now) if now < 2.0 else Action(0.0)), steady("pid", 0.0)
    supervisor = magnetic(best, second, rules=Rules(retry_s=0.1, retry_longest_s=1.0))
    run(supervisor, 1000)
    assert best.asked == 5
    assert supervisor.active == "pid"
    run(supervisor, 600, start=1000)
    assert supervisor.active == "mpc"


def test_taking_over_resets_to_the_command_in_force_and_does_not_step() -> None:
    best, second = Stub("mpc", lambda now: Action(4e-3) if now < 1.0 else raises(now)), steady("pid", -4e-3)
    supervisor = magnetic(best, second, rules=Rules(blend_s=0.2))
    commands = [action.command for action in run(supervisor, 1000)]
    assert second.resets[0][1] == pytest.approx(4e-3)
    assert max(np.abs(np.diff(commands[400:]))) <= 8e-3 * DT / 0.2 * 1.5  # a carriage that started late catches up
    assert commands[-1] == pytest.approx(-4e-3, abs=1e-6)


def test_limits_in_force_too_long_count_as_a_failure() -> None:
    best, second = steady("mpc", 0.2), steady("pid", 1e-3)
    supervisor = magnetic(best, second, rules=Rules(limit_s=0.2, retry_s=5.0, retry_longest_s=5.0))
    actions = run(supervisor, 400)
    assert supervisor.active == "pid"
    assert "gap" in supervisor.events[-1].reason
    assert all(abs(action.command) <= 0.02 / math.sqrt(3) for action in actions)


def test_limits_that_are_hit_now_and_then_are_no_failure() -> None:
    best = Stub("mpc", lambda now: Action(0.2 if now % 0.2 < 0.1 else 0.0))
    supervisor = magnetic(best, steady("pid", 0.0), rules=Rules(limit_s=0.2))
    run(supervisor, 1000)
    assert supervisor.active == "mpc"


def test_a_hot_drive_is_switched_off() -> None:
    supervisor = Supervisor([steady("mpc", 0.5)], envelope_of(Coil()))
    supervisor.reset(0.0, estimate(0.0), 0.0)
    run(supervisor, 100)
    supervisor.temperature_C = 44.0
    assert run(supervisor, 1, start=100)[0].command == 0.0


def test_an_inner_mass_is_switched_and_not_blended() -> None:
    supervisor = Supervisor([Stub("waveform", lambda now: Action(float(now % 0.1 < 0.05)))], envelope_of(Vibro()))
    supervisor.reset(0.0, estimate(0.0), 0.0)
    assert {action.command for action in run(supervisor, 200)} == {0.0, 1.0}


def test_an_empty_chain_is_refused() -> None:
    with pytest.raises(ValueError, match="chain must have one controller or more"):
        Supervisor([], envelope_of(Magnetic()))
    with pytest.raises(ValueError, match="rule blend_s must be"):
        Rules(blend_s=-1.0)
