"""The monitor's word fits its frame whatever it says."""

import math
from typing import get_args

import pytest

from controller.monitor import Change, Health, State
from hil.bus.protection import Receiver, Sender
from hil.nodes.frame_map import frames
from hil.nodes.view import CHANGES, HEALTH_S, STATES, health_values

FRAME = frames()["ModelHealth"]


def test_names_and_numbers_are_those_of_the_dbc() -> None:
    names = {name.replace("_", " "): raw for raw, name in FRAME.field("State").names.items()}
    assert names == STATES
    assert set(STATES) == set(get_args(State))
    changes = {"" if name == "none" else name: raw for raw, name in FRAME.field("Change").names.items()}
    assert changes == CHANGES
    assert set(CHANGES) == set(get_args(Change))
    assert FRAME.cycle_s == HEALTH_S


@pytest.mark.parametrize(
    "health",
    [
        Health(),
        Health("broken", 12.34, "slow", 3, 1.2),
        Health("broken", 1e9, "sudden", 999, 1e9),
        Health("not watched"),
    ],
)
@pytest.mark.parametrize("began", [0.0, 1e6, -math.inf])
def test_every_word_is_a_frame(health: Health, began: float) -> None:
    found = Receiver(FRAME).accept(Sender(FRAME).frame(health_values(health, began)), 0.0)
    assert isinstance(found, dict)
    assert found["State"] == STATES[health.state]
    assert found["Alarms"] == min(health.alarms, 255)
