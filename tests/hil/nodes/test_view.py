"""What is shown to those who watch fits its frames, whatever is believed, and comes once in 40 ms."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controller.model.control_model import control_model
from controller.signals import Estimate
from hil.app.scenario.rig_file import read_deployed_rig
from hil.bus.codec import without_absent
from hil.bus.protection import Receiver, Sender
from hil.log.blf_file import SENT
from hil.log.reader import read_frames
from hil.nodes.frame_map import frames
from hil.nodes.view import VIEW_S, WALL, force_values, motion_values, wanted_values
from models.theta import Theta
from tests.hil.app.run.test_run_ends import led
from tests.places import ROOT

RIG = read_deployed_rig(ROOT / "examples" / "deployment" / "deployment.toml")
MODEL = control_model(RIG, Theta(), 2e-3)
STATE = MODEL.initial(0.01, 0.012)
BELIEF = Estimate(1.0, STATE, np.full_like(STATE, 2e-4), 1e-3)


def sent(name: str, values: dict[str, float]) -> dict[str, float]:
    frame = frames()[name]
    found = Receiver(frame).accept(Sender(frame).frame(values), 0.0)
    assert isinstance(found, dict)
    return found


def test_names_and_cycle_are_those_of_the_dbc() -> None:
    assert {name: raw for raw, name in frames()["BelievedMotion"].field("Wall").names.items()} == WALL
    assert {frames()[name].cycle_s for name in ("BelievedMotion", "BelievedForces", "WantedMotion")} == {VIEW_S}


def test_what_is_believed_comes_through() -> None:
    motion = sent("BelievedMotion", motion_values(MODEL, BELIEF, -1.2))
    assert motion["Position_m"] == pytest.approx(0.01, abs=2e-7)
    assert motion["Std_m"] == pytest.approx(2e-4, abs=5e-6)
    assert motion["Wall"] == WALL["sticks"]
    assert motion["Surprise"] == pytest.approx(-1.2, abs=0.01)
    told = force_values(MODEL, BELIEF, 0.012, 1.0)
    assert told is not None
    forces = sent("BelievedForces", told)
    magnet = RIG.magnet
    assert magnet is not None
    gap = 0.002
    pull = magnet.magnet_stiffness_N_per_m * gap / (1 + (gap / magnet.magnet_range_m) ** 2) ** 2
    assert forces["Drive_N"] == pytest.approx(pull, abs=1e-4)
    assert forces["Lacking_N"] == pytest.approx(1e-3, abs=1e-4)


def test_a_wall_that_slips_is_told_with_its_direction() -> None:
    state = STATE.copy()
    state[MODEL.index("slip")] = -1.0
    assert motion_values(MODEL, replace(BELIEF, state=state), 0.0)["Wall"] == WALL["slips_backward"]


@pytest.mark.parametrize("number", [math.nan, math.inf, -1e9, 1e9])
def test_every_belief_is_a_frame_or_none(number: float) -> None:
    """What is no number is told as none: a lost belief, no frame of forces, a place that is not followed."""
    nothing, finite = np.full_like(STATE, number), math.isfinite(number)
    belief = Estimate(1.0, nothing, nothing, number)
    motion = sent("BelievedMotion", motion_values(MODEL, belief, number))
    assert (motion["Wall"] == WALL["lost"]) is not finite
    surprise = without_absent("BelievedMotion", {**motion, "Wall": 0.0})["Surprise"]
    assert surprise == pytest.approx(math.copysign(9.98, number)) if finite else math.isnan(surprise)
    forces = force_values(MODEL, belief, number, 1.0)
    assert forces is None or sent("BelievedForces", forces)
    assert forces is None or finite
    assert sent("WantedMotion", wanted_values(number, number, True, 1000))["Following"] == finite


@pytest.mark.parametrize(
    ("frame", "values", "silent"),
    [
        ("CapsuleLocalisation", {"Position_m": 0.0, "Quality": 0.0, "Age_s": 0.0, "Valid": 0.0}, 3),
        ("ForceReading", {"Force_N": 0.0, "Age_s": 0.0, "Valid": 0.0}, 2),
        ("BelievedMotion", {"Position_m": 0.0, "Std_m": 0.0, "Wall": 3.0, "Surprise": 0.0}, 3),
        ("BelievedMotion", {"Position_m": 0.0, "Std_m": 0.0, "Wall": 0.0, "Surprise": -10.0}, 1),
        ("ModelHealth", {"State": 3.0, "Change": 0.0, "Since_s": 0.0, "Evidence": 0.0, "Alarms": 0.0}, 2),
        ("CarriageFeedback", {"Position_m": 0.0, "Velocity_m_s": 0.0, "State": 4.0, "Temperature_degC": -40.0}, 1),
        ("CapsuleLocalisation", {"Position_m": 0.0, "Quality": 0.0, "Age_s": 0.0, "Valid": 1.0}, 0),
    ],
)
def test_what_a_frame_does_not_say_is_no_number(frame: str, values: dict[str, float], silent: int) -> None:
    assert sum(map(math.isnan, without_absent(frame, sent(frame, values)).values())) == silent


def test_surprise_is_never_the_zero_of_a_tick_without_a_reading(tmp_path: Path) -> None:
    """Where localisation comes in, each frame tells of its newest reading; where it is lost for 0.3 s, of none."""
    _, node = led(tmp_path, {"kind": "lost", "at_s": 0.8, "duration_s": 0.3})
    assert node.state is not None
    reception, told = Receiver(frames()["BelievedMotion"]), list[tuple[float, float]]()
    for frame in read_frames(tmp_path / "run.blf"):
        if frame.direction == SENT and frame.id == frames()["BelievedMotion"].id:
            values = reception.accept(frame.data, frame.time_s)
            assert isinstance(values, dict)
            told.append((frame.time_s, without_absent("BelievedMotion", values)["Surprise"]))
    at, surprise = np.array(told).T
    inside = (at > 0.9) & (at < 1.05)
    assert np.isnan(surprise[inside]).all()
    seen = surprise[(at > 0.3) & (at < 0.78)]
    assert np.isfinite(seen).all()
    assert len(np.unique(seen)) > 5
    assert np.abs(seen).max() > 0.1
