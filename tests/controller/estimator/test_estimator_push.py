"""A peristaltic push: the estimate follows it, and so does who relies on the estimate."""

import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import hil
from hil.app.scenario.scenario import load_track_scenario, parse_track_scenario
from hil.app.track.loop import LoopTrace, believed_model, run_loop
from models.theta import Theta
from plant import layout as at

SCENARIOS = Path(hil.__file__).parent / "scenarios"
RAMP = (SCENARIOS / "track_magnetic_ramp.toml").read_text().replace("duration_s = 20.0", "duration_s = 8.0")
PUSH = "\n[effects.peristaltic_wave]\nforce_N = 0.08\nperiod_s = 7.0\n"


def estimate_error(trace: LoopTrace) -> NDArray[np.float64]:
    """Estimated less true position in m, once the belief has been proven."""
    truth = np.interp(trace.time_s, trace.rows[:, at.O_T], trace.rows[:, at.O_X])
    return (trace.position_m - truth)[trace.time_s > 1.0]


def test_a_push_of_80_mN_is_followed() -> None:
    """Within 0.4 mm rms by the estimate, where the localisation alone has 0.5 mm."""
    scenario = parse_track_scenario(tomllib.loads(RAMP + PUSH))
    trace = run_loop(scenario, believed_model(scenario, Theta()), "feedforward", 1)
    assert np.sqrt(np.mean(estimate_error(trace) ** 2)) < 0.4e-3
    assert not trace.lost[trace.time_s > 1.0].any()


def test_pushes_against_a_coil_are_followed() -> None:
    """Nothing ties the capsule to a coil: 90 mN carry it until they are known. The estimate errs less than a reading
    does, the capsule no more.
    """
    scenario = load_track_scenario(SCENARIOS / "track_coil_push_12.toml")
    trace = run_loop(scenario, believed_model(scenario, Theta()), "feedforward", 1)
    t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
    assert np.sqrt(np.mean(estimate_error(trace) ** 2)) < 0.4e-3
    assert np.sqrt(np.mean((x - scenario.reference.position(t))[t > 1.0] ** 2)) < 0.5e-3
