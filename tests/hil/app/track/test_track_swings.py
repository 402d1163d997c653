"""A coil behind a lag that nobody told: whoever swings is taken out, and the limits hold."""

from typing import Any

import pytest

from hil.app.scenario.scenario import parse_track_scenario
from hil.app.track.loop import LoopTrace, believed_model, run_loop
from hil.app.track.score import score
from models.theta import Theta

RAMP = {"kind": "ramp", "speed_mm_s": 5.0, "start_s": 0.5}


def led(lag_s: float, controller: str, seconds: float = 6.0) -> tuple[LoopTrace, Any]:
    scenario = parse_track_scenario(
        {
            "scenario": {"duration_s": seconds, "seed": 3},
            "rig": {"kind": "coil"},
            "tissue": {"preset": "jejunum"},
            "effects": {"actuator_lag": {"time_s": lag_s}},
            "reference": RAMP,
        }
    )
    trace = run_loop(scenario, believed_model(scenario, Theta()), controller, 3)
    return trace, score(scenario, trace)


@pytest.mark.parametrize("lag_s", [0.06, 0.11, 0.15])
@pytest.mark.parametrize("controller", ["mpc", "pid", "feedforward"])
def test_a_lag_that_nobody_told_breaks_no_limit(lag_s: float, controller: str) -> None:
    """The true speed was up to 2.8 times its limit in up to 1,816 ticks."""
    trace, worth = led(lag_s, controller)
    assert worth.hard_violations == 0
    tried = [event for event in trace.events if event.after == controller and event.reason == "tried again"]
    assert len(tried) <= 3, "not put back again and again"
    assert trace.halted or worth.tracking_max_m < 0.02
