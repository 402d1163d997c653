"""A simulated CiA 402 drive, led through the adapter in simulated time: what it follows, what stops and what faults
it.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import closing

import can
import pytest

from hil.drives.cia402_protocol import DISABLED, FAULTED, OPERATION
from hil.drives.cia402_setup import set_up
from hil.nodes.frame_map import DERATED, ENABLE, FAULT, OFF, QUICK_STOP, READY
from tests.hil.drives.cia402_ends import LIMITS, TABLE, Ends, Polled, command
from tests.hil.ticks import TICK


class Stamping:
    """A bus whose frames arrive at the simulated time at which they are read."""

    def __init__(self, inner: can.BusABC, now: Callable[[], float]) -> None:
        self._inner, self._now, self.send = inner, now, inner.send

    def recv(self, timeout: float | None) -> can.Message | None:
        message = self._inner.recv(timeout)
        if message is not None:
            message.timestamp = self._now()
        return message


class Desk:
    """Adapter and simulated drive in one simulated time, set up and led as a controller would."""

    def __init__(self, polled: Polled, channel: str) -> None:
        with can.Bus(interface="virtual", channel=channel) as bus:
            set_up(bus, TABLE, LIMITS, TICK)
            time.sleep(0.05)
        polled.halt()
        self.drive, self.now, self.beats = polled.drive, 10.0, True
        self.drive.bus = Stamping(self.drive.bus, lambda: self.now)
        self.ends = Ends(channel)
        self.ends.far.shutdown()
        self.place = 0.0

    def ticks(self, number: int, mode: int, speed_m_s: float = 0.0, *, silent: bool = False) -> None:
        """Ticks of 2 ms; `silent`: the controller says nothing."""
        for k in range(number):
            if not silent:
                self.ends.say("Sync", {"Tick": k, "Period_s": TICK})
                self.place += speed_m_s * TICK
                self.ends.say("CarriageCommand", command(mode, self.place))
                if self.beats:
                    self.ends.say("ControllerHeartbeat", {"State": 2, "Uptime_s": 0.0, "Catalogue": 0})
            for _ in range(2):
                self.drive.listen(self.now, 2)
                self.drive.output(1e-3, 0.0)
                self.now += 1e-3
            while self.ends.near.recv(0) is not None:
                pass

    def up(self) -> None:
        self.ticks(4, OFF)
        self.ticks(4, READY)
        self.ticks(6, ENABLE)


@pytest.fixture
def desk(request: pytest.FixtureRequest) -> Iterator[Desk]:
    """A drive set up and at rest."""
    with closing(Polled(request.node.name)) as polled:
        found = Desk(polled, request.node.name)
        yield found
        found.ends.near.shutdown()


def test_it_follows_in_cyclic_synchronous_position(desk: Desk) -> None:
    desk.up()
    assert desk.drive.state == OPERATION
    desk.ticks(100, ENABLE, 0.1)
    assert desk.drive.power.output == pytest.approx(desk.place, abs=2 * 0.1 * TICK)
    assert desk.drive.power.rate == pytest.approx(0.1, rel=0.05)


def test_enable_alone_starts_nothing(desk: Desk) -> None:
    desk.ticks(20, ENABLE, 0.1)
    assert (desk.drive.state, desk.drive.power.output) == (DISABLED, 0.0)


def test_silence_is_a_latched_fault_at_rest_within_25_ms(desk: Desk) -> None:
    """From full speed; and a reset leads to disabled, from where only off, ready, enable lead up."""
    desk.up()
    desk.ticks(50, ENABLE, 0.25)
    assert desk.drive.power.rate == pytest.approx(0.25, rel=0.02)
    last = desk.drive.good_at
    while not desk.drive.safe and desk.now < last + 0.1:
        desk.ticks(1, ENABLE, silent=True)
    assert desk.now - last <= 0.025 + 1e-9
    assert desk.drive.stage.state == FAULT
    desk.place = desk.drive.power.output
    desk.ticks(20, ENABLE, 0.1)
    assert (desk.drive.state, desk.drive.error) == (FAULTED, 0x8250)
    desk.ends.say("DriveReset", {"Target": 1, "Code": 4})
    desk.ticks(20, ENABLE, 0.1)
    assert (desk.drive.state, desk.drive.error) == (DISABLED, 0)
    desk.place = desk.drive.power.output
    desk.up()
    assert desk.drive.state == OPERATION


def test_a_lost_heartbeat_and_heat_are_faults(desk: Desk) -> None:
    desk.up()
    desk.beats = False
    desk.ticks(29, ENABLE)
    assert desk.drive.state == OPERATION
    desk.ticks(4, ENABLE)
    assert (desk.drive.state, desk.drive.error) == (FAULTED, 0x8130)
    desk.beats = True
    desk.ends.say("DriveReset", {"Target": 0, "Code": 5})
    desk.ticks(4, OFF)
    desk.up()
    desk.drive.heated_to_C = 42.0
    desk.ticks(2, ENABLE)
    assert desk.drive.stage.state == DERATED
    desk.drive.heated_to_C = 44.0
    desk.ticks(110, ENABLE)
    assert (desk.drive.state, desk.drive.error) == (FAULTED, 0x4310)


def test_quick_stop_brakes_at_25_m_s2_and_disables(desk: Desk) -> None:
    desk.up()
    desk.ticks(50, ENABLE, 0.25)
    place, at = desk.drive.power.output, desk.now
    while not desk.drive.safe and desk.now < at + 0.1:
        desk.ticks(1, QUICK_STOP)
    assert desk.now - at <= 0.010 + 2 * TICK + 1e-9
    assert desk.drive.power.output - place <= 0.25**2 / (2 * 25.0) + 0.25 * 2 * TICK
    desk.ticks(2, QUICK_STOP)
    assert desk.drive.state == DISABLED


@pytest.mark.parametrize(
    ("wrong", "words", "within_s"),
    [("jammed", "following error (bit 13", 0.065), ("ignores", "it does not follow its target (bit 12", 0.02)],
)
def test_one_that_says_that_it_does_not_follow_is_disabled(desk: Desk, wrong: str, words: str, within_s: float) -> None:
    """At 0.25 m/s a motor that does not turn is 5 mm off after 20 ms, which it says after 20 ms more."""
    desk.up()
    desk.ticks(50, ENABLE, 0.25)
    setattr(desk.drive, wrong, True)
    since = desk.now
    while desk.drive.state == OPERATION and desk.now < since + 1.0:
        desk.ticks(1, ENABLE, 0.25)
    assert desk.now - since <= within_s
    assert words in desk.ends.near.trouble
    desk.ticks(50, ENABLE, 0.25)
    assert desk.drive.state == DISABLED


def test_beyond_its_own_travel_it_says_so(desk: Desk) -> None:
    desk.drive.power.output = desk.place = 0.9999
    desk.up()
    desk.ticks(20, ENABLE, 0.1)
    assert "at a limit of its own" in desk.ends.near.trouble
    assert desk.drive.power.output <= LIMITS.travel_m
