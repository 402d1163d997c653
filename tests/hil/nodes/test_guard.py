"""The guard on the wire: which frames leave, what they say, and how often a stop is told."""

import math
from dataclasses import replace

import can
import pytest

from hil.bus.protection import Receiver
from hil.nodes.frame_map import ENABLE, OFF, READY, frame_map_of, frames
from hil.nodes.guard import STOP_PERIOD_S, Guard, Passed
from tests.hil.fences import CARRIAGE, GOOD
from tests.hil.ticks import TICK


class Wire(can.BusABC):
    """Keeps what is sent, and how long its sender would have waited; refuses all of it where `dead`."""

    def __init__(self) -> None:
        super().__init__(channel="wire")
        self.sent: list[can.Message] = []
        self.timeouts: set[float | None] = set()
        self.dead: Exception | None = None
        self.shutdown()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.timeouts.add(timeout)
        if self.dead is not None:
            raise self.dead
        self.sent.append(msg)


@pytest.fixture
def wire() -> Wire:
    """A bus that keeps what is sent."""
    return Wire()


def guard_on(wire: Wire, **more: object) -> Guard:
    """A carriage's guard."""
    return Guard(wire, frame_map_of("magnetic"), CARRIAGE, **more)  # type: ignore[arg-type]


def test_the_whitelist(wire: Wire) -> None:
    guard = guard_on(wire)
    assert not guard.send("CoilCommand", frame_map_of("coil").values(0.0, 0.0, ENABLE), 0.0)
    assert not guard.send("Nonsense", {}, 0.0)
    assert not guard.send("Nonsense", {}, 0.1)
    assert guard.refused == {"CoilCommand": 1, "Nonsense": 2}
    assert not wire.sent
    for name, values in (
        ("Sync", {"Tick": 1, "Period_s": TICK}),
        ("DriveReset", {"Target": 1, "Code": 4}),
        ("SafeStop", {"Target": 0, "Reason": 0}),
        ("ControllerHeartbeat", {"State": 1, "Uptime_s": 0.0, "Catalogue": 0}),
        ("ModelHealth", {"State": 2, "Change": 1, "Since_s": 3.0, "Evidence": 1.1, "Alarms": 1}),
    ):
        assert guard.send(name, values, 1.5)
        assert wire.sent[-1].arbitration_id == frames()[name].id
        assert (wire.sent[-1].timestamp, wire.sent[-1].is_extended_id, wire.sent[-1].is_rx) == (1.5, False, False)
    assert wire.timeouts == {0}, "the control path never waits for the bus"


def test_what_does_not_fit_its_frame_is_not_sent(wire: Wire) -> None:
    guard = guard_on(wire)
    assert not guard.send("Sync", {"Tick": 1, "Period_s": math.nan}, 0.0)
    assert not guard.send("Sync", {"Tick": 1}, 0.0)
    assert guard.refused == {"Sync": 2}
    assert (wire.sent, guard.unsent) == ([], 0)


@pytest.mark.parametrize("error", [can.CanOperationError("off the bus"), OSError("no buffer space")])
def test_a_bus_that_takes_nothing(wire: Wire, error: Exception) -> None:
    seen: list[can.Message] = []
    guard = guard_on(wire, observe=seen.append)
    wire.dead = error
    assert not guard.send("Sync", {"Tick": 1, "Period_s": TICK}, 0.0)
    guard.command(0.0, 0.0, OFF, GOOD)
    assert (guard.unsent, seen, guard.refused) == (2, [], {})


def test_dry_run_sends_nothing_and_shows_all(wire: Wire) -> None:
    seen: list[can.Message] = []
    guard = guard_on(wire, dry=True, observe=seen.append)
    assert not guard.send("Sync", {"Tick": 1, "Period_s": TICK}, 0.0)
    guard.command(0.0, 0.0, OFF, GOOD)
    assert (len(seen), wire.sent) == (2, [])


def test_the_command_frame(wire: Wire) -> None:
    """What leaves is protected and says what was let out, with its time to live."""
    seen: list[can.Message] = []
    guard, receiver = guard_on(wire, observe=seen.append), Receiver(frames()["CarriageCommand"])
    guard.command(0.0, 0.1, READY, GOOD)
    out = guard.command(TICK, 0.1002, ENABLE, GOOD)
    assert out == guard.sent
    assert [m.arbitration_id for m in wire.sent] == [256, 256]
    assert seen == wire.sent
    first, second = (receiver.accept(m.data, m.timestamp) for m in wire.sent)
    assert isinstance(first, dict)
    assert isinstance(second, dict)
    assert (first["Mode"], second["Mode"]) == (READY, ENABLE)
    assert second["Position_m"] == pytest.approx(0.1002, abs=1e-7)
    assert second["Velocity_m_s"] == pytest.approx(0.1, abs=3e-5)
    assert (first["TimeToLive_ms"], second["TimeToLive_ms"]) == (18, 14)


def test_the_first_command_moves_as_if_two_ticks_had_passed(wire: Wire) -> None:
    assert guard_on(wire).command(10.0, 1.0, ENABLE, GOOD).value == pytest.approx(0.25 * 2 * TICK)


def test_slew_counts_the_time_between_commands(wire: Wire) -> None:
    guard = guard_on(wire)
    assert guard.sent == Passed(0.0, 0.0, OFF)
    guard.command(10.0, 0.1, READY, GOOD)
    assert guard.command(10.0 + TICK, 1.0, ENABLE, GOOD).value == pytest.approx(0.1 + 0.25 * TICK)
    assert guard.command(10.0 + 9 * TICK, 1.0, ENABLE, GOOD).value == pytest.approx(0.1 + 3 * 0.25 * TICK)


def test_a_stop_is_told_twice(wire: Wire) -> None:
    """Quick stop in the command, and a safe stop at once and every 20 ms while it holds, anew with each stop."""
    guard, stop = guard_on(wire), frames()["SafeStop"].id
    late = replace(GOOD, feedback_s=1.0)
    told = []
    for k in range(25):
        guard.command(k * TICK, 0.0, ENABLE, late)
        if wire.sent[-1].arbitration_id == stop:
            told.append(k)
    assert told == [0, 10, 20]
    values = Receiver(frames()["SafeStop"]).accept(wire.sent[1].data, 0.0)
    assert values == {"Target": 1, "Reason": 2}
    guard.command(25 * TICK, 0.0, OFF, GOOD)
    guard.command(26 * TICK, 0.0, ENABLE, late)
    assert wire.sent[-1].arbitration_id == stop


def test_when_a_stop_is_told_again(wire: Wire) -> None:
    """Not twice at the same moment, at half a tick before the period, and with the time it is told at."""
    guard, stop = guard_on(wire), frames()["SafeStop"].id
    late = replace(GOOD, feedback_s=1.0)
    for now in (0.0, 0.0, STOP_PERIOD_S - 0.5 * TICK):
        guard.command(now, 0.0, ENABLE, late)
    assert [m.timestamp for m in wire.sent if m.arbitration_id == stop] == [0.0, STOP_PERIOD_S - 0.5 * TICK]


def test_a_clock_that_goes_back_does_not_silence_the_stop(wire: Wire) -> None:
    guard, stop = guard_on(wire), frames()["SafeStop"].id
    late = replace(GOOD, feedback_s=1.0)
    guard.command(5.0, 0.0, ENABLE, late)
    guard.command(1.0, 0.0, ENABLE, late)
    assert [m.arbitration_id for m in wire.sent].count(stop) == 2
