"""A carriage that is a CiA 402 drive: its states and words, its set-up over SDO, and the same controller leading it over CANopen."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.limits import Limits
from hil.app.run_clock import Clock, ClockedBus
from hil.app.run_file import parse_deployment
from hil.bus.catalogue import load_catalogue
from hil.bus.protection import Receiver, Sender
from hil.nodes import cia402
from hil.nodes.cia402 import (
    DISABLED,
    ENABLE_OPERATION,
    FAULTED,
    HALT_QUICKLY,
    NOT_READY,
    OPERATION,
    QUICK_STOPPING,
    REACTING,
    READY_TO_SWITCH_ON,
    RESET_FAULT,
    RPDO,
    SWITCHED_ON,
    TPDO_MORE,
    TPDO_STATE,
    Cia402Table,
    controlword,
    fault_of,
    next_state,
    shown,
    state_of,
    statusword_of,
)
from hil.nodes.cia402_bus import Cia402Bus
from hil.nodes.cia402_setup import set_up
from hil.nodes.power import CarriagePower
from hil.nodes.wiring import (
    BOOT,
    DERATED,
    ENABLE,
    ENABLED,
    FAULT,
    OFF,
    QUICK_STOP,
    READY,
    STANDBY,
    STOPPING,
    WAITING,
    wiring_of,
)
from tests.hil.deployments import PLANT, deployment

STATES = range(NOT_READY, FAULTED + 1)
TICK, LIMITS, TABLE = 2e-3, Limits(), Cia402Table()
NAMES = (
    "NOT READY TO SWITCH ON",
    "SWITCH ON DISABLED",
    "READY TO SWITCH ON",
    "SWITCHED ON",
    "OPERATION ENABLED",
    "QUICK STOP ACTIVE",
    "FAULT REACTION ACTIVE",
    "FAULT",
)


def test_statuswords_are_those_of_another_program() -> None:
    """canopen's own table of masks names the same state for every 16-bit word."""
    peer = pytest.importorskip("canopen.profiles.p402", reason="needs the package canopen (extra canopen)")
    masks = peer.State402.SW_MASK
    for word in range(1 << 16):
        named = [name for name, (mask, value) in masks.items() if word & mask == value]
        assert NAMES[state_of(word)] == (named[0] if named else NAMES[NOT_READY])
    words = peer.State402.CW_COMMANDS_CODE
    assert (words["OPERATION ENABLED"], words["QUICK STOP ACTIVE"], words["SWITCH ON DISABLED"]) == (
        ENABLE_OPERATION,
        HALT_QUICKLY,
        RESET_FAULT,
    )


def test_what_a_drive_shows() -> None:
    expected = (BOOT, STANDBY, WAITING, WAITING, ENABLED, STOPPING, FAULT, FAULT)
    assert tuple(shown(statusword_of(state)) for state in STATES) == expected
    assert shown(statusword_of(OPERATION, warning=True)) == DERATED
    assert shown(statusword_of(SWITCHED_ON, warning=True)) == WAITING
    assert [fault_of(e) for e in (0x2310, 0x4310, 0x8250, 0x8130, 0x8611)] == [1, 2, 4, 5, 11]


@given(
    st.sampled_from(STATES), st.lists(st.tuples(st.sampled_from([OFF, READY, ENABLE, QUICK_STOP]), st.booleans()), max_size=12)
)
def test_enabled_only_by_ready_then_enable(state: int, asked: list[tuple[int, bool]]) -> None:
    """From wherever a drive stands, operation is reached only over "ready" while disabled, with "enable" asked for afterwards; no
    reset gets further than "disabled"."""
    before, readied = 0, state in (READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION)
    for mode, reset in asked:
        word = controlword(mode, state, reset=reset)
        after = next_state(state, word, before, cause=False, at_rest=True)
        if state == FAULTED:
            assert after == (DISABLED if reset and not before & RESET_FAULT else FAULTED)
        if state == DISABLED:
            readied = mode == READY
            assert after == (READY_TO_SWITCH_ON if readied else DISABLED)
        if after == OPERATION:
            assert readied
            assert mode == ENABLE
        state, before = after, word


@pytest.mark.parametrize("mode", [OFF, READY, QUICK_STOP])
def test_whatever_stops_a_moving_drive_brakes_it(mode: int) -> None:
    word = controlword(mode, OPERATION)
    assert word == HALT_QUICKLY
    state = next_state(OPERATION, word, ENABLE_OPERATION, cause=False, at_rest=False)
    assert state == QUICK_STOPPING
    assert controlword(mode, state) == controlword(ENABLE, state) == HALT_QUICKLY
    assert next_state(state, word, word, cause=False, at_rest=False) == QUICK_STOPPING
    assert next_state(state, word, word, cause=False, at_rest=True) == DISABLED


def test_a_fault_brakes_then_is_latched_while_its_cause_lasts() -> None:
    assert next_state(OPERATION, ENABLE_OPERATION, 0, cause=True, at_rest=False) == REACTING
    assert next_state(REACTING, ENABLE_OPERATION, 0, cause=True, at_rest=False) == REACTING
    assert next_state(REACTING, ENABLE_OPERATION, 0, cause=True, at_rest=True) == FAULTED
    assert next_state(FAULTED, RESET_FAULT, 0, cause=True, at_rest=True) == FAULTED
    assert next_state(FAULTED, RESET_FAULT, RESET_FAULT, cause=False, at_rest=True) == FAULTED
    assert next_state(FAULTED, RESET_FAULT, 0, cause=False, at_rest=True) == DISABLED


class Ends:
    """An adapter with its two ends: `far` is where the drive hears and speaks."""

    def __init__(self, name: str) -> None:
        self.far = can.Bus(interface="virtual", channel=name)
        self.catalogue = load_catalogue()
        self.near = Cia402Bus(can.Bus(interface="virtual", channel=name), TABLE, self.catalogue)
        self._senders: dict[str, Sender] = {}

    def say(self, name: str, values: dict[str, float]) -> None:
        """The controller sends a frame of the catalogue."""
        sender = self._senders.setdefault(name, Sender(self.catalogue[name]))
        self.near.send(can.Message(arbitration_id=self.catalogue[name].id, is_extended_id=False, data=sender.frame(values)))

    def told(self) -> list[tuple[int, bytes]]:
        """What came out at the drive's end."""
        found = []
        while (message := self.far.recv(0)) is not None:
            found.append((message.arbitration_id, bytes(message.data)))
        return found

    def show(self, identifier: int, data: bytes) -> list[can.Message]:
        """The drive says something; what the controller hears of it."""
        self.far.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data))
        found = []
        while (message := self.near.recv(0)) is not None:
            found.append(message)
        return found

    def close(self) -> None:
        self.near.shutdown()
        self.far.shutdown()


@pytest.fixture
def ends(request: pytest.FixtureRequest) -> Iterator[Ends]:
    """An adapter and a drive's end."""
    both = Ends(request.node.name)
    yield both
    both.close()


def command(mode: int, place: float) -> dict[str, float]:
    return wiring_of("magnetic").values(place, 0.0, mode)


def test_a_command_leaves_as_words_and_counts(ends: Ends) -> None:
    ends.show(0x181, TPDO_STATE.pack(statusword_of(SWITCHED_ON), 0))
    ends.say("CarriageCommand", command(ENABLE, -0.1234567))
    assert ends.told() == [(0x201, RPDO.pack(ENABLE_OPERATION, -123457))]
    ends.say("Sync", {"Tick": 1, "Period_s": TICK})
    assert [identifier for identifier, _ in ends.told()] == [0x80, cia402.SYNC_ID]
    ends.say("ControllerHeartbeat", {"State": 2, "Uptime_s": 0.0, "Catalogue": 0})
    assert ends.told() == [(0x77F, b"\x05")]


@pytest.mark.parametrize(("target", "words"), [(0, [HALT_QUICKLY]), (1, [HALT_QUICKLY]), (2, [])])
def test_a_safe_stop_brakes_the_carriage_it_concerns(ends: Ends, target: int, words: list[int]) -> None:
    ends.show(0x181, TPDO_STATE.pack(statusword_of(OPERATION), 777))
    ends.say("SafeStop", {"Target": target, "Reason": 0})
    told = ends.told()
    assert [RPDO.unpack(data) for identifier, data in told if identifier == 0x201] == [(word, 777) for word in words]
    assert told[-1][0] == 16


def test_a_reset_is_one_edge(ends: Ends) -> None:
    ends.show(0x181, TPDO_STATE.pack(statusword_of(FAULTED), 0))
    ends.say("DriveReset", {"Target": 1, "Code": 4})
    assert ends.told() == []
    for _ in range(2):
        ends.say("CarriageCommand", command(ENABLE, 0.0))
    assert [RPDO.unpack(data)[0] for _, data in ends.told()] == [RESET_FAULT, 0]


def test_what_the_drive_says_is_heard_protected(ends: Ends) -> None:
    receiver = Receiver(ends.catalogue["CarriageFeedback"])
    assert ends.show(0x281, TPDO_MORE.pack(-20000, 0)) == []
    (heard,) = ends.show(0x181, TPDO_STATE.pack(statusword_of(OPERATION), -500000))
    values = receiver.accept(heard.data, heard.timestamp)
    assert isinstance(values, dict)
    assert values["State"] == ENABLED
    assert values["Position_m"] == pytest.approx(-0.5)
    assert values["Velocity_m_s"] == pytest.approx(-0.02)
    ends.show(0x181, TPDO_STATE.pack(statusword_of(FAULTED), 0))
    faults = ends.show(0x281, TPDO_MORE.pack(0, 0x8250))
    told = Receiver(ends.catalogue["CarriageFault"]).accept(faults[0].data, 0.0)
    assert len(faults) == 2
    assert told == {"Code": 4, "Detail": 0x8250}
    assert ends.show(0x281, TPDO_MORE.pack(0, 0x8250)) == []


@given(st.sampled_from([0x181, 0x281, 0x701]), st.binary(max_size=8))
def test_nothing_that_a_drive_says_raises(identifier: int, data: bytes) -> None:
    ends = Ends("fuzzed")
    try:
        for message in ends.show(identifier, data):
            assert message.arbitration_id in (33, 32, 384, 1809)
    finally:
        ends.close()


class Polled:
    """A simulated drive whose firmware runs in a thread of its own."""

    def __init__(self, channel: str) -> None:
        drive = pytest.importorskip("hil.nodes.cia402_drive", reason="needs the package canopen (extra canopen)")
        self.bus = ClockedBus(can.Bus(interface="virtual", channel=channel), Clock())
        power = CarriagePower(LIMITS.carriage_speed_m_s, LIMITS.travel_m)
        self.drive = drive.Cia402Drive(self.bus, TABLE, power, LIMITS, TICK)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.is_set():
            self.drive.listen(self.bus.clock.now(), 2)
            time.sleep(5e-4)

    def halt(self) -> None:
        """From now on the test itself runs the firmware."""
        self._over.set()
        self._thread.join()

    def close(self) -> None:
        self.halt()
        self.bus.shutdown()


@pytest.fixture
def polled(request: pytest.FixtureRequest) -> Iterator[Polled]:
    """A drive that answers."""
    found = Polled(request.node.name)
    yield found
    found.close()


def test_set_up_over_sdo(polled: Polled, request: pytest.FixtureRequest) -> None:
    """Everything is written, read back and taken: PDO maps, the deadline of commands, the reactions; and the drive stays disabled."""
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        set_up(bus, TABLE, LIMITS, TICK, 10)
        time.sleep(0.1)
    polled.halt()
    node = polled.drive.node
    assert polled.drive.state == DISABLED
    assert [v.index for v in node.rpdo[1].map] == [0x6040, 0x607A]
    assert [v.index for v in node.tpdo[1].map] == [0x6041, 0x6064]
    assert (node.sdo[0x1400][5].raw, node.sdo[0x1016][1].raw) == (10, 127 << 16 | 60)
    assert (node.sdo[0x605A].raw, node.sdo[0x605E].raw, node.sdo[0x6007].raw) == (2, 2, 1)
    assert (node.sdo[0x607D][1].raw, node.sdo[0x607F].raw) == (-1_000_000, 250_000)


@pytest.mark.parametrize("missing", ["nobody", "canopen"])
def test_no_drive_or_no_package_is_one_sentence(
    missing: str, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    if missing == "canopen":
        monkeypatch.setitem(sys.modules, "canopen", None)
    else:
        pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    with can.Bus(interface="virtual", channel=request.node.name) as bus, pytest.raises(ValueError, match="cia402") as found:
        set_up(bus, Cia402Table(answers_s=0.1), LIMITS, TICK, 10)
    assert "\n" not in str(found.value)
    assert ("install the extra" if missing == "canopen" else "node 1 must answer") in str(found.value)


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
            set_up(bus, TABLE, LIMITS, TICK, 10)
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
def desk(polled: Polled, request: pytest.FixtureRequest) -> Iterator[Desk]:
    """A drive set up and at rest."""
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
    ("text", "sentence"),
    [
        ("node_id = 16", "cia402.node_id must lie in"),
        ("counts_per_m = 0.0", "cia402.counts_per_m must lie in"),
        ("answers_s = -1.0", "cia402.answers_s must lie in"),
        ("nodeid = 1", "did you mean"),
    ],
)
def test_bad_tables(text: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        parse_deployment(deployment(more=f"[cia402]\n{text}\n"), {})


def test_only_a_carriage_speaks_it() -> None:
    text = deployment(more="[cia402]\n").replace('kind = "magnetic"', 'kind = "coil"')
    text = text.replace("magnet_stiffness_N_per_m = 25.0", "").replace("magnet_range_m = 0.02", "force_constant_N_per_A = 0.5")
    with pytest.raises(ValueError, match=r"cia402 must stand with rig\.kind magnetic"):
        parse_deployment(text, {})


def test_the_same_controller_leads_it_in_real_time(tmp_path: Path, channel: str) -> None:
    """Two processes: `capsule run` with `[cia402]` sets the drive up, leads it through its states, and replays bit by bit."""
    pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    (tmp_path / "plant.toml").write_text(PLANT)
    rig, log = tmp_path / "rig.toml", tmp_path / "run.blf"
    rig.write_text(deployment(channel, control="duration_s = 1.5\npriority = 20", more="[cia402]\nanswers_s = 5.0\n"))
    plant = [
        sys.executable,
        "-m",
        "hil.app.run_plant",
        str(tmp_path / "plant.toml"),
        "capsule_local",
        channel,
        "60",
        "20",
        "cia402",
    ]
    for _ in range(3):
        child = subprocess.Popen(plant, stdout=subprocess.PIPE, text=True)
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        command = [sys.executable, "-m", "hil.app.main", "run", str(rig), "--log", str(log), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        child.terminate()
        truth: dict[str, Any] = json.loads(child.communicate()[0])
        assert done.stdout, done.stderr
        found = json.loads(done.stdout)
        if found["ended"] == "time is up":
            break
    assert (found["ended"], done.returncode) == ("time is up", 0)
    assert found["refused"] == found["unsent"] == 0
    assert truth["moved_m"] == pytest.approx(2e-3 * 1.5, abs=1.5e-3)
    assert truth["state"] == STANDBY
    replayed = subprocess.run(
        [sys.executable, "-m", "hil.app.main", "replay", str(log)], capture_output=True, text=True, check=False
    )
    assert replayed.returncode == 0, replayed.stdout
