"""The guard: nothing unsafe leaves, whatever is asked for, and what is fine leaves unchanged."""

import math
from dataclasses import replace

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.envelope import envelope_of
from controller.limits import Limits
from hil.bus.protection import Receiver
from hil.nodes.guard import STOP_PERIOD_S, Evidence, Fence, Guard, Passed, passed
from hil.nodes.wiring import (
    BOOT,
    DERATED,
    ENABLE,
    ENABLED,
    FAULT,
    OFF,
    QUICK_STOP,
    READY,
    SELF_TEST,
    STANDBY,
    STOPPING,
    WAITING,
    frames,
    wiring_of,
)
from models.drives.coil import Coil
from models.drives.magnetic import Magnetic

TICK = 2e-3
CARRIAGE = Fence(-1.0, 1.0, 0.25, True, TICK)
COIL = Fence(-0.8, 0.8, 100.0, False, TICK)
GOOD = Evidence(0.012, 0.003, ENABLED)
ANY = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.none(),
    st.text(max_size=3),
    st.integers(),
    st.complex_numbers(),
    st.booleans(),
)


def on(value: float = 0.0, **more: object) -> Passed:
    """What was let out before: enabled at `value`."""
    return replace(Passed(value, 0.0, ENABLE), **more)


class Wire(can.BusABC):
    """Keeps what is sent, and how long its sender would have waited; refuses all of it where `dead`."""

    def __init__(self) -> None:
        super().__init__(channel="wire")
        self.sent: list[can.Message] = []
        self.patience: set[float | None] = set()
        self.dead: Exception | None = None
        self.shutdown()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.patience.add(timeout)
        if self.dead is not None:
            raise self.dead
        self.sent.append(msg)


@pytest.fixture
def wire() -> Wire:
    """A bus that keeps what is sent."""
    return Wire()


def guard_on(wire: Wire, **more: object) -> Guard:
    """A carriage's guard."""
    return Guard(wire, frames(), wiring_of("magnetic"), CARRIAGE, **more)  # type: ignore[arg-type]


def test_a_fine_command_leaves_unchanged() -> None:
    assert passed(0.1004, ENABLE, GOOD, on(0.1), TICK, CARRIAGE) == Passed(0.1004, pytest.approx(0.2), ENABLE)
    assert passed(-0.1, ENABLE, GOOD, on(0.0), TICK, COIL) == Passed(-0.1, pytest.approx(-50.0), ENABLE)


@pytest.mark.parametrize(("wanted", "left"), [(5.0, 0.8), (-5.0, -0.8), (0.8, 0.8), (-0.8, -0.8)])
def test_range(wanted: float, left: float) -> None:
    out = passed(wanted, ENABLE, GOOD, on(), 2 * TICK, replace(COIL, rate=math.inf))
    assert (out.value, out.reason) == (left, "limit" if left != wanted else "")


def test_what_is_no_more_than_a_rounding_counts_as_fine() -> None:
    """1e-9 of the range, whatever the range."""
    wide = replace(COIL, low=-1000.0, high=1000.0, rate=math.inf)
    assert passed(1000.0 + 1e-6, ENABLE, GOOD, on(), TICK, wide).reason == ""
    assert passed(1000.0 + 3e-6, ENABLE, GOOD, on(), TICK, wide).reason == "limit"


def test_travel() -> None:
    assert passed(5.0, ENABLE, GOOD, on(0.9999), TICK, CARRIAGE).value == 1.0
    assert passed(-5.0, ENABLE, GOOD, on(-0.9999), TICK, CARRIAGE).value == -1.0


def test_slew_holds_both_ways_and_from_the_first_command() -> None:
    assert passed(1.0, ENABLE, GOOD, on(0.1), TICK, CARRIAGE) == Passed(
        pytest.approx(0.1005), pytest.approx(0.25), ENABLE, 0, "limit"
    )
    assert passed(-1.0, ENABLE, GOOD, on(0.1), TICK, CARRIAGE).value == pytest.approx(0.0995)
    assert passed(1.0, ENABLE, GOOD, Passed(0.1, 0.0, READY), TICK, CARRIAGE).value == pytest.approx(0.1005)


def test_slew_of_a_current() -> None:
    assert passed(0.8, ENABLE, GOOD, on(), TICK, COIL).value == pytest.approx(0.2)
    assert passed(0.8, ENABLE, replace(GOOD, localisation_s=0.1), on(), TICK, COIL).value == pytest.approx(0.2)


@pytest.mark.parametrize(("dt", "step"), [(10.0, 2 * TICK), (math.inf, 2 * TICK), (0.0, 0.0), (-1.0, 0.0), (math.nan, 0.0)])
def test_a_strange_clock_makes_no_room(dt: float, step: float) -> None:
    out = passed(1.0, ENABLE, GOOD, on(), dt, CARRIAGE)
    assert out.value == pytest.approx(0.25 * step)
    assert out.rate == (pytest.approx(0.25) if step else 0.0)


@pytest.mark.parametrize("mode", [OFF, READY])
def test_other_modes_move_nothing(mode: int) -> None:
    """Before it is enabled the carriage's command is where it is; a current is none."""
    assert passed(0.3, mode, GOOD, on(0.1), TICK, CARRIAGE) == Passed(0.3, 0.0, mode)
    assert passed(3.0, mode, GOOD, on(0.1), TICK, CARRIAGE).value == 1.0
    assert passed(math.nan, mode, GOOD, on(0.1), TICK, CARRIAGE).value == 0.1
    assert passed(0.3, mode, GOOD, on(0.1), TICK, COIL) == Passed(0.0, 0.0, mode)


def test_a_missing_command_is_held_then_fades_then_stops() -> None:
    first = passed(math.nan, ENABLE, GOOD, on(0.4), TICK, COIL)
    second = passed("none", ENABLE, GOOD, first, TICK, COIL)
    third = passed(None, ENABLE, GOOD, second, TICK, COIL)
    assert (first.value, first.missed, first.reason, first.mode) == (0.4, 1, "late", ENABLE)
    assert (second.value, second.missed, second.reason) == (pytest.approx(0.2), 2, "late")
    assert (third.value, third.mode, third.reason) == (0.0, QUICK_STOP, "controller late")
    again = passed(0.4, ENABLE, GOOD, second, TICK, COIL)
    assert (again.missed, again.mode) == (0, ENABLE)


def test_a_carriage_without_commands_stays() -> None:
    first = passed(math.inf, ENABLE, GOOD, on(0.4), TICK, CARRIAGE)
    second = passed(math.nan, ENABLE, GOOD, first, TICK, CARRIAGE)
    assert (first.value, second.value, second.rate) == (0.4, 0.4, 0.0)
    assert passed(math.nan, ENABLE, GOOD, second, TICK, CARRIAGE) == Passed(0.4, 0.0, QUICK_STOP, 3, "controller late")


@pytest.mark.parametrize(
    ("evidence", "reason"),
    [
        (replace(GOOD, feedback_s=0.010), ""),
        (replace(GOOD, feedback_s=0.0101), "feedback lost"),
        (replace(GOOD, feedback_s=math.nan), "feedback lost"),
        (replace(GOOD, feedback_s=-TICK), ""),
        (replace(GOOD, feedback_s=-1.01 * TICK), "feedback lost"),
        (replace(GOOD, localisation_s=0.15), ""),
        (replace(GOOD, localisation_s=0.1501), "localisation lost"),
        (replace(GOOD, localisation_s=math.inf), "localisation lost"),
        (replace(GOOD, localisation_s=-1.01 * TICK), "localisation lost"),
        (replace(GOOD, localisation_s=-TICK), ""),
        *((replace(GOOD, state=s), "drive not enabled") for s in (BOOT, SELF_TEST, STANDBY, STOPPING, FAULT)),
        *((replace(GOOD, state=s), "") for s in (WAITING, ENABLED, DERATED)),
    ],
)
def test_evidence(evidence: Evidence, reason: str) -> None:
    for fence, rest in ((CARRIAGE, 0.1), (COIL, 0.0)):
        out = passed(0.1, ENABLE, evidence, on(0.1), TICK, fence)
        assert out == (Passed(rest, 0.0, QUICK_STOP, 0, reason) if reason else Passed(0.1, 0.0, ENABLE))


def test_old_localisation_halves_what_is_allowed() -> None:
    old = replace(GOOD, localisation_s=0.0501)
    assert passed(1.0, ENABLE, old, on(0.1), TICK, CARRIAGE).value == pytest.approx(0.1 + 0.5 * 0.25 * TICK)
    assert passed(0.8, ENABLE, old, on(0.4), TICK, COIL).value == 0.4
    assert passed(-0.8, ENABLE, old, on(-0.4), TICK, COIL).value == -0.4
    assert passed(0.9, ENABLE, old, on(0.9), TICK, CARRIAGE) == Passed(0.9, 0.0, ENABLE), "a carriage is slowed, not drawn back"
    just = replace(GOOD, localisation_s=0.05)
    assert passed(1.0, ENABLE, just, on(0.1), TICK, CARRIAGE).value == pytest.approx(0.1005)


def test_a_stop_holds_until_another_mode_is_asked_for() -> None:
    stopped = Passed(0.1, 0.0, QUICK_STOP, 0, "feedback lost")
    assert passed(0.2, ENABLE, GOOD, stopped, TICK, CARRIAGE) == stopped
    off = passed(0.1, OFF, GOOD, stopped, TICK, CARRIAGE)
    assert (off.mode, off.reason) == (OFF, "")
    assert passed(0.1, ENABLE, GOOD, off, TICK, CARRIAGE).mode == ENABLE


@given(
    wanted=st.lists(
        st.tuples(ANY, st.sampled_from([OFF, READY, ENABLE]), st.floats(), st.floats(), st.floats(), st.integers(0, 9))
    ),
    fence=st.sampled_from([CARRIAGE, COIL]),
)
def test_whatever_is_asked_for(wanted: list[tuple[object, int, float, float, float, int]], fence: Fence) -> None:
    """Finite, within range and slew while enabled, and enabled on good evidence alone."""
    before = Passed(0.0, 0.0, OFF)
    for value, mode, dt, place, feed, state in wanted:
        out = passed(value, mode, Evidence(place, feed, state), before, dt, fence)
        assert fence.low <= out.value <= fence.high
        assert math.isfinite(out.rate)
        if out.mode == ENABLE:
            assert abs(out.value - before.value) <= fence.rate * 2 * TICK * (1 + 1e-9)
            assert place <= fence.stop_s
            assert feed <= fence.feedback_s
            assert state in (WAITING, ENABLED, DERATED)
            assert before.mode != QUICK_STOP
        before = out


def test_fence_of_limits() -> None:
    limits = Limits(current_A=0.7, age_s=0.12)
    carriage = Fence.of(envelope_of(Magnetic(25.0, 0.02), limits), TICK)
    assert (carriage.low, carriage.high, carriage.rate, carriage.rests) == (-1.0, 1.0, 0.25, True)
    assert (carriage.tick_s, carriage.stop_s) == (TICK, 0.12)
    coil = Fence.of(envelope_of(Coil(0.5), limits), TICK)
    assert (coil.low, coil.high, coil.rate, coil.rests) == (-0.7, 0.7, 1200.0, False)


def test_the_whitelist(wire: Wire) -> None:
    guard = guard_on(wire)
    assert not guard.send("CoilCommand", wiring_of("coil").values(0.0, 0.0, ENABLE), 0.0)
    assert not guard.send("Nonsense", {}, 0.0)
    assert not guard.send("Nonsense", {}, 0.1)
    assert guard.refused == {"CoilCommand": 1, "Nonsense": 2}
    assert not wire.sent
    for name, values in (
        ("Sync", {"Tick": 1, "Period_s": TICK}),
        ("DriveReset", {"Target": 1, "Code": 4}),
        ("SafeStop", {"Target": 0, "Reason": 0}),
        ("ControllerHeartbeat", {"State": 1, "Uptime_s": 0.0, "Catalogue": 0}),
    ):
        assert guard.send(name, values, 1.5)
        assert wire.sent[-1].arbitration_id == frames()[name].id
        assert (wire.sent[-1].timestamp, wire.sent[-1].is_extended_id, wire.sent[-1].is_rx) == (1.5, False, False)
    assert wire.patience == {0}, "the control path never waits for the bus"


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
