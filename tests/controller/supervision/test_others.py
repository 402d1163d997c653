"""A broken model does not lead on where one beside it predicts better; one that holds is left alone."""

import numpy as np
import pytest

from hil.app.scenario.scenario import TrackScenario, parse_track_scenario
from hil.app.track.loop import LoopTrace, believed_model, run_loop
from models.theta import Theta
from plant import layout as at

LAG_S = 0.15


def sine(lag_s: float) -> TrackScenario:
    return parse_track_scenario(
        {
            "scenario": {"duration_s": 16.0},
            "rig": {"kind": "magnetic"},
            "tissue": {"preset": "jejunum"},
            "localisation": {"std": 1e-4},
            "control": {"tick_s": 0.002},
            "reference": {"kind": "sine", "amplitude_mm": 15.0, "frequency_Hz": 0.2},
            "effects": {"actuator_lag": {"time_s": lag_s}} if lag_s else {},
        }
    )


def led(lag_s: float, leading: Theta, **others: Theta) -> tuple[LoopTrace, float]:
    """A run, and its error in mm over the last 6 s, rms."""
    scenario = sine(lag_s)
    beside = {name: believed_model(scenario, values) for name, values in others.items()}
    trace = run_loop(scenario, believed_model(scenario, leading), "feedforward", 1, others=beside)
    t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
    return trace, 1e3 * float(np.sqrt(np.mean((x - scenario.reference.position(t))[t > 10] ** 2)))


LAGGING = Theta.of({("actuator_lag", "time_s"): LAG_S}.items())


def test_the_better_model_leads_on() -> None:
    """It tracks within a tenth of what it does where it leads from the start."""
    alone, without = led(LAG_S, Theta())
    _, right = led(LAG_S, LAGGING)
    trace, error = led(LAG_S, Theta(), lagging=LAGGING)
    assert alone.health.state == "broken"
    assert not alone.switched
    assert [name for _, name in trace.switched] == ["lagging"]
    assert error < 1.1 * right < without
    (event,) = [one for one in trace.events if one.reason == "the model is broken, lagging predicts better"]
    assert event.before == event.after != "stop"


def test_a_model_that_holds_leads_as_if_alone() -> None:
    alone, _ = led(LAG_S, LAGGING)
    trace, _ = led(LAG_S, LAGGING, nominal=Theta())
    assert not trace.switched
    assert np.array_equal(trace.command, alone.command)


def test_more_than_four_are_refused() -> None:
    with pytest.raises(ValueError, match="others must be 4 models or fewer; got 5"):
        led(0.0, Theta(), **{f"m{k}": LAGGING for k in range(5)})
