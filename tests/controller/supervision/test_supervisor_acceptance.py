"""A new model under the supervisor: taken at rest only, without a step, and never past a gate that refused it."""

import numpy as np
import pytest

from controller.supervision.acceptance import Acceptance
from controller.supervision.fallback import Rules
from tests.controller.supervision.supervisor_stubs import DT, Ramp, estimate, magnetic, run, steady

PASSED, REFUSED = Acceptance(), Acceptance(("worse on held-out records",))


def test_a_new_model_is_taken_at_rest_only_and_without_a_step() -> None:
    old, new = steady("mpc", 2e-3), steady("mpc 2", 3e-3)
    supervisor = magnetic(old, rules=Rules(rest_s=0.2, blend_s=0.2))
    run(supervisor, 200)
    assert supervisor.offer([new], PASSED)
    run(supervisor, 200, start=200)
    assert not supervisor.take_offered()
    run(supervisor, 200, start=400, believed=lambda t: estimate(t, v=5e-3), reference=Ramp(0.0))
    assert not supervisor.take_offered()
    run(supervisor, 80, start=600, reference=Ramp(0.0))
    assert not supervisor.take_offered()
    run(supervisor, 40, start=680, reference=Ramp(0.0))
    assert supervisor.take_offered()
    assert not supervisor.take_offered()
    actions = run(supervisor, 360, start=720, reference=Ramp(0.0))
    assert supervisor.active == "mpc 2"
    assert new.resets[0][1] == pytest.approx(2e-3)
    assert max(np.abs(np.diff([action.command for action in actions]))) <= 1e-3 * DT / 0.2 * 1.01
    assert actions[-1].command == pytest.approx(3e-3)


def test_a_model_that_did_not_pass_the_gate_is_never_taken() -> None:
    old, new = steady("mpc", 0.0), steady("mpc 2", 0.0)
    supervisor = magnetic(old)
    assert not supervisor.offer([new], REFUSED)
    run(supervisor, 1000, reference=Ramp(0.0))
    assert not supervisor.take_offered()
    assert supervisor.active == "mpc"
    assert any("worse on held-out" in event.reason for event in supervisor.events)
