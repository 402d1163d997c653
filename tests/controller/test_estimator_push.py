"""A peristaltic push: the estimate follows it, and so does who relies on the estimate."""

import tomllib
from pathlib import Path

import numpy as np

import hil
from hil.app.track_loop import believed_model, run_loop
from hil.app.track_scenario import parse_track_scenario
from plant import layout as at

RAMP = (
    (Path(hil.__file__).parent / "scenarios" / "track_magnetic_ramp.toml")
    .read_text()
    .replace("duration_s = 20.0", "duration_s = 8.0")
)
PUSH = "\n[effects.peristaltic_wave]\nforce_N = 0.08\nperiod_s = 7.0\n"


def test_a_push_of_80_mN_is_followed() -> None:
    """Within 0.4 mm rms by the estimate, where the localisation alone has 0.5 mm."""
    scenario = parse_track_scenario(tomllib.loads(RAMP + PUSH))
    trace = run_loop(scenario, believed_model(scenario, {}), "feedforward", 1)
    truth = np.interp(trace.time_s, trace.rows[:, at.O_T], trace.rows[:, at.O_X])
    error = (trace.position_m - truth)[trace.time_s > 1.0]
    assert np.sqrt(np.mean(error**2)) < 0.4e-3
    assert not trace.lost[trace.time_s > 1.0].any()
