"""What the cards show: states, what was refused and why, events, a node that falls silent and comes back."""

import can

from hil.app.cockpit.panels import Facts
from hil.app.cockpit.source import BusSource, LogSource
from hil.app.cockpit.watch import KEPT, FrameWatch
from hil.app.run.clock import Clock
from hil.log.blf_file import Logged
from hil.nodes.frame_map import FRAME_MAPS
from tests.hil.app.cockpit.story import BREAKS_S, CATALOGUE, story
from tests.hil.scripted_bus import ScriptedBus

FACTS = Facts("test", "", FRAME_MAPS["magnetic"], CATALOGUE)


def watched(frames: list[Logged]) -> FrameWatch:
    watch = FrameWatch(CATALOGUE)
    for frame in frames:
        watch.take(frame.time_s, frame.id, frame.data)
    return watch


def test_the_story_is_told() -> None:
    watch = watched(story(2.5))
    told = watch.document()
    drive = next(one for one in told["nodes"] if one["role"] == "drive")
    assert (drive["node"], drive["state"], drive["grade"]) == ("carriage", "enabled", "good")
    assert told["model"]["state"] == "broken"
    assert told["model"]["why"] == "its forecasts miss: identify it again with 'capsule close-loop' from this log"
    assert [name for name, _ in told["model"]["facts"]] == ["model", "evidence", "since", "alarms"]
    assert told["readings"]["position"].endswith(" mm")
    assert told["readings"]["speed"] in {"2 mm/s", "2.00 mm/s"}
    said = [event.words for event in watch.events]
    assert "carriage: ready → enabled" in said
    assert "controller leads the capsule" in said
    assert any(words.startswith("model: holds → broken (sudden change): its forecasts miss") for words in said)
    broken = next(event for event in watch.events if "broken" in event.words)
    assert broken.grade == "bad"
    assert abs(broken.time_s - BREAKS_S) < 0.2


def test_refused_frames_are_counted_by_frame_and_reason_and_told_once() -> None:
    watch = watched(story(2.8))
    damaged = "damaged on the way: check wiring, termination and bit rate"
    assert watch.document()["refused"] == [["CapsuleLocalisation", damaged, 3]]
    assert sum("refused" in event.words for event in watch.events) == 1
    watch.take(3.0, 0x7FE, b"12345678")
    assert watch.document()["bus"]["unknown"] == 1


def test_who_falls_silent_is_told_and_who_comes_back() -> None:
    watch = watched(story(0.5))
    watch.tick(1.0)
    assert any(event.words.startswith("carriage is silent: sends nothing any more") for event in watch.events)
    assert watch.document()["readings"]["position"] == "–"
    for frame in story(1.6):
        if frame.time_s > 1.2:
            watch.take(frame.time_s, frame.id, frame.data)
    assert "carriage is heard again" in [event.words for event in watch.events]


def test_nothing_that_comes_grows_without_bound_or_raises() -> None:
    watch = FrameWatch(CATALOGUE)
    for k in range(5000):
        watch.take(1e-3 * k, k % 2048, bytes(k % 9))
    assert len(watch.events) <= KEPT


def test_a_bus_that_raises_is_told_of_and_tried_again() -> None:
    source = BusSource(ScriptedBus(OSError("network is down"), None), Clock(), FACTS)
    source.poll()
    assert source.document()["trouble"].startswith("the bus cannot be read: network is down; check its cable")
    source.poll()
    assert source.document()["trouble"].startswith("nothing heard yet: check that drive and bus are on")


def test_a_log_has_the_state_of_any_time() -> None:
    log = LogSource(story(3.0), FACTS)
    assert log.end_s > 2.9
    early, late = log.document(1.0), log.document(2.9)
    assert (early["model"]["state"], late["model"]["state"]) == ("holds", "broken")
    assert [row[::2] for row in early["refused"]] == [["CapsuleLocalisation", 1]]


def test_a_picture_takes_bounded_time_and_calls_nobody_silent_whose_frames_still_wait() -> None:
    frames = story(10.0, bad=False)
    messages = [can.Message(frame.time_s, frame.id, False, data=frame.data) for frame in frames]
    clock = Clock()
    source = BusSource(ScriptedBus(*messages), clock, FACTS)
    clock.origin_ns -= 20 * 10**9  # all of it was said long ago
    source.poll()
    assert 0 < source.watch.count < len(messages)
    assert not [event for event in source.watch.events if "is silent" in event.words]
    while source.watch.count < len(messages):
        source.poll()
    source.poll()
    assert [event for event in source.watch.events if event.words.startswith("controller is silent")]
