"""Every reason for which the controller stops or does not lead has a remedy."""

import pytest

from hil.app.run.loop import TEXT as OF_A_RUN
from hil.nodes.receive import REASONS, remedy
from tests.hil.app.docs.ends import RUN_ENDS

STOPS = (
    *("controller late", "controller paused for 0.05 s, in which nothing was received", "clock jumped"),
    *("feedback lost", "drive not enabled", "localisation lost", "localisation stuck", "localisation jumped"),
    *("drive does not follow", "drive left operation", "drive heartbeat lost", "drive knows another DBC"),
    *("drive fault 4 (time to live)", "mpc limited too long: slip", "pid swings about the reference"),
    "two localisers are on the bus (LocaliserHeartbeat has the uptimes of two)",
    "drive heartbeat refused: its counters are not one node's",
)
GOOD = ("done", "operator", "reset", "cancelled", "log")


@pytest.mark.parametrize("ended", [*STOPS, *(end.sentence for name, end in RUN_ENDS.items() if name not in GOOD)])
def test_a_reason_has_a_remedy(ended: str) -> None:
    assert remedy(ended) or ended.startswith("gave up: ")


@pytest.mark.parametrize("key", ["missing.localisation", "missing.stamped", "missing.newest", "missing.feedback"])
def test_what_was_missing_has_a_remedy(key: str) -> None:
    assert remedy(OF_A_RUN(key, age="1 s", most="50 ms"))


@pytest.mark.parametrize("state", ["boot", "self_test", "standby", "ready", "quick_stop", "fault", "other"])
def test_a_drive_that_is_not_enabled_has_a_remedy(state: str) -> None:
    assert remedy(OF_A_RUN(f"state.{state}"))


def test_what_ended_as_asked_needs_none() -> None:
    assert [RUN_ENDS[name].sentence for name in GOOD[:3] if remedy(RUN_ENDS[name].sentence)] == [
        RUN_ENDS["reset"].sentence
    ]
    assert len({remedy(parts[0]) for parts in REASONS.values()}) == len(REASONS)
