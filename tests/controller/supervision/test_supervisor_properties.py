"""The supervisor under whatever may happen: nothing raises, nothing gets past the limits."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.drives import envelope_of
from controller.signals import Action, Estimate
from controller.supervision.fallback import Rules
from controller.supervision.supervisor import Supervisor
from models.drives.coil import Coil
from models.drives.magnetic import Magnetic
from models.drives.vibro import Vibro
from tests.controller.supervision.supervisor_stubs import DT, Ramp, Stub, estimate, raises

answers = st.one_of(
    st.just(raises),
    st.floats().map(lambda c: lambda now: Action(c)),
    st.floats(-0.01, 0.01).map(lambda c: lambda now: Action(c)),
    # type: ignore[arg-type]
    st.sampled_from(["late", "failed", "lost", "stopped", "nonsense"]).map(lambda s: lambda now: Action(1e-3, s)),
    st.just(lambda now: None),
)
estimates = st.builds(
    lambda age, x, v, lost: lambda t: Estimate(t - age, np.array([x, v]), np.zeros(2), 0.0, lost),
    st.one_of(st.floats(0, 0.01), st.floats()),
    st.one_of(st.floats(-0.1, 0.1), st.floats()),
    st.one_of(st.floats(-0.01, 0.01), st.floats()),
    st.booleans(),
)


@given(
    script=st.lists(
        st.tuples(answers, answers, estimates, st.one_of(st.just(DT), st.floats())), min_size=1, max_size=30
    ),
    drive=st.sampled_from([Magnetic(), Coil(), Vibro()]),
)
def test_nothing_that_happens_raises_or_gets_past_the_limits(
    script: list[tuple[Any, Any, Any, float]], drive: Any
) -> None:
    turn = {"best": raises, "second": raises}
    chain = [Stub(name, lambda now, name=name: turn[name](now)) for name in turn]  # type: ignore[misc]
    envelope = envelope_of(drive)
    supervisor = Supervisor(chain, envelope, Rules(retry_s=0.0))
    supervisor.reset(0.0, estimate(0.0), 0.0)
    now, before = 0.0, supervisor.issued
    for best, second, believed, dt in script:
        turn.update(best=best, second=second)
        now += dt
        action = supervisor.act(now, believed(now), Ramp(0.0))
        assert math.isfinite(action.command)
        assert envelope.low <= action.command <= envelope.high
        if drive.name == "magnetic":
            step = envelope.rate * envelope.limits.longest_tick_s
            assert abs(action.command - before.command) <= step + np.spacing(
                abs(before.command) + step
            )  # one rounding of the sum
        before = replace(supervisor.issued)
