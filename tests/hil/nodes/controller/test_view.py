"""What is shown to those who watch fits its frames, whatever is believed, and comes once in 40 ms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.model.control_model import control_model
from controller.signals import Estimate
from hil.app.scenario.deployment import read_deployed_rig
from hil.bus.protection import Receiver, Sender
from hil.nodes.controller.view import VIEW_S, WALL, force_values, motion_values, wanted_values
from hil.nodes.frame_map import frames
from tests.places import ROOT

RIG = read_deployed_rig(ROOT / "examples" / "deployment" / "deployment.toml")
MODEL = control_model(RIG, {}, 2e-3)
STATE = MODEL.initial(0.01, 0.012)
BELIEF = Estimate(1.0, STATE, np.full_like(STATE, 2e-4), 1e-3, innovations=(0.5, -1.2))


def sent(name: str, values: dict[str, float]) -> dict[str, float]:
    frame = frames()[name]
    found = Receiver(frame).accept(Sender(frame).frame(values), 0.0)
    assert isinstance(found, dict)
    return found


def test_names_and_cycle_are_those_of_the_dbc() -> None:
    assert {name: raw for raw, name in frames()["BelievedMotion"].field("Wall").names.items()} == WALL
    assert {frames()[name].cycle_s for name in ("BelievedMotion", "BelievedForces", "WantedMotion")} == {VIEW_S}


def test_what_is_believed_comes_through() -> None:
    motion = sent("BelievedMotion", motion_values(MODEL, BELIEF))
    assert motion["Position_m"] == pytest.approx(0.01, abs=2e-7)
    assert motion["Std_m"] == pytest.approx(2e-4, abs=5e-6)
    assert motion["Wall"] == WALL["sticks"]
    assert motion["Surprise"] == pytest.approx(-1.2, abs=0.01)
    forces = sent("BelievedForces", force_values(MODEL, BELIEF, 0.012, 1.0))
    magnet = RIG.magnet
    assert magnet is not None
    gap = 0.002
    pull = magnet.magnet_stiffness_N_per_m * gap / (1 + (gap / magnet.magnet_range_m) ** 2) ** 2
    assert forces["Drive_N"] == pytest.approx(pull, abs=1e-4)
    assert forces["Lacking_N"] == pytest.approx(1e-3, abs=1e-4)


def test_a_wall_that_slips_is_told_with_its_direction() -> None:
    state = STATE.copy()
    state[MODEL.index("slip")] = -1.0
    assert motion_values(MODEL, replace(BELIEF, state=state))["Wall"] == WALL["slips_backward"]


@pytest.mark.parametrize("number", [math.nan, math.inf, -1e9, 1e9])
def test_every_belief_is_a_frame(number: float) -> None:
    nothing = np.full_like(STATE, number)
    belief = Estimate(1.0, nothing, nothing, number, True, innovations=(number,))
    assert sent("BelievedMotion", motion_values(MODEL, belief))["Wall"] == WALL["lost"]
    sent("BelievedForces", force_values(MODEL, belief, number, 1.0))
    sent("WantedMotion", wanted_values(number, number, False, 1000))
