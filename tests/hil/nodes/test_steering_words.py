"""What is said of steering: each state and each reason of a refusal has its own sentence, which a user understands."""

import pytest

from hil.nodes.frame_map import frames
from hil.nodes.operator import STATUS
from hil.nodes.operator_sender import OperatorAnswer, steering_words

STATES = list(frames()[STATUS].field("State").names.values())
REASONS = [name for name in frames()[STATUS].field("Refused").names.values() if name != "none"]


def said(state: str = "held", source: str = "nobody", refused: str = "none") -> str:
    return steering_words(OperatorAnswer(state, source, refused, -0.0123, 0.0), True, "cockpit")


def test_each_state_and_each_refusal_has_a_sentence_of_its_own() -> None:
    sentences = [*(said(state) for state in STATES), *(said(refused=reason) for reason in REASONS)]
    assert len(set(sentences)) == len(STATES) + len(REASONS)
    assert "nobody" not in said("moving", "cockpit")


@pytest.mark.parametrize("source", ["cockpit", "joystick"])
def test_the_end_of_the_range_is_told_to_everybody(source: str) -> None:
    words = "the end of the range is reached at −12.30 mm: go back, or widen [operator] lowest_m and highest_m"
    assert said("held", source, "range") == words


def test_another_one_in_charge_is_named() -> None:
    assert said("moving", "joystick", "busy").startswith("joystick steers: release, wait until joystick has let go")
    assert said(refused="busy").startswith("another sender steers")
    assert said("moving", "cockpit", "busy") == "cockpit steers, at −12.30 mm"


def test_a_controller_that_takes_no_setpoints_is_told_from_none() -> None:
    assert "set [operator] accept = true" in steering_words(None, True, "cockpit")
    assert steering_words(None, False, "cockpit").startswith("no controller runs: start one")
