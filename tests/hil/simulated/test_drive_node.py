"""A drive node on a bus: whom it follows, what faults it, and what brings it back."""

import can
import pytest

from controller.limits import Limits
from hil.bus.protection import Sender
from hil.nodes.frame_map import (
    BOOT,
    DERATED,
    ENABLE,
    ENABLED,
    FAULT,
    HEARTBEAT_LOST,
    OFF,
    OVER_CURRENT,
    OVER_TEMPERATURE,
    READY,
    SELF_TEST,
    STANDBY,
    TIME_TO_LIVE,
    answer_of,
    frame_map_of,
    frames,
)
from hil.simulated.drive_node import HOT_S, DriveNode
from hil.simulated.medium import Medium, SimulatedBus
from hil.simulated.power_stage import CarriagePower, CoilPower, InnerMassPower, Power
from tests.hil.scripted_bus import ScriptedBus
from tests.hil.ticks import SLOT, TICK


class Desk:
    """A drive on a bus and a hand that sends it frames."""

    def __init__(self, kind: str, power: Power) -> None:
        self.medium = Medium()
        self.bus = SimulatedBus(self.medium, "Hand")
        self.frame_map = frame_map_of(kind)
        self.port = SimulatedBus(self.medium, "Drive")
        self.drive = DriveNode(self.port, self.frame_map, power, Limits(), TICK)
        self.senders = {f.name: Sender(f) for f in frames().frames.values()}
        self.now, self.mode, self.value = 0.0, OFF, 0.0
        self.alive, self.uptime_s = True, 0.0
        self.heard: list[can.Message] = []
        self.ticks, self.answers = 0, True

    def say(self, name: str, **values: float) -> None:
        data = self.senders[name].frame(values)
        self.bus.send(can.Message(arbitration_id=frames()[name].id, is_extended_id=False, data=data))

    def go(self, seconds: float) -> None:
        """Ticks as a controller makes them, as long as it is alive."""
        for _ in range(round(seconds / TICK)):
            if self.alive:
                self.say("Sync", Tick=self.ticks, Period_s=TICK)
                self.say("ControllerHeartbeat", State=2, Uptime_s=self.uptime_s, Catalogue=frames().fingerprint)
                self.say(self.frame_map.command, **self.frame_map.values(self.value, 0.0, self.mode))
            for k in range(2):
                self.medium.advance(self.now + 2e-4 + k * SLOT)
                self.drive.listen(self.medium.now_s, 2)
                self.drive.output(SLOT, self.drive.power.output)
            self.now += TICK
            self.ticks += 1
            self.medium.advance(self.now)
            while (message := self.bus.recv(0)) is not None:
                self.heard.append(message)
                if self.answers and message.arbitration_id == frames()[self.frame_map.challenge].id:
                    number = int.from_bytes(message.data, "little") >> 12 & 0xFFFFFFFF
                    self.say(
                        "EnableAnswer", Target=self.frame_map.target, Answer=answer_of(number, self.frame_map.target)
                    )

    def enable(self) -> None:
        """Through boot, off and ready to enabled."""
        self.go(0.08)
        for self.mode in (OFF, READY, ENABLE):
            self.go(0.01)

    @property
    def state(self) -> int:
        return self.drive.stage.state


@pytest.fixture(params=["magnetic", "coil", "vibro"])
def desk(request: pytest.FixtureRequest) -> Desk:
    """Each kind of drive, enabled."""
    powers: dict[str, Power] = {
        "magnetic": CarriagePower(0.25, 1.0),
        "coil": CoilPower(1.0, 10.0, 10e-3),
        "vibro": InnerMassPower(),
    }
    made = Desk(request.param, powers[request.param])
    made.enable()
    assert made.state == ENABLED
    return made


def test_a_silent_controller_faults_the_drive_and_only_reset_and_the_whole_way_bring_it_back(desk: Desk) -> None:
    desk.alive = False
    desk.go(0.02)
    assert (desk.state, desk.drive.stage.fault, desk.drive.safe) == (FAULT, TIME_TO_LIVE, True)
    told = [m for m in desk.heard if m.arbitration_id == frames()[desk.frame_map.fault].id]
    assert len(told) == 2
    desk.alive = True
    desk.go(0.1)
    assert desk.state == FAULT
    desk.say("DriveReset", Target=desk.frame_map.target, Code=OVER_CURRENT)
    desk.go(0.01)
    assert desk.state == FAULT
    desk.say("DriveReset", Target=desk.frame_map.target, Code=TIME_TO_LIVE)
    desk.go(0.1)
    assert desk.state == STANDBY
    for desk.mode in (OFF, READY, ENABLE):
        desk.go(0.01)
    assert desk.state == ENABLED


def test_a_controller_that_begins_anew_is_told_of_a_fault(desk: Desk) -> None:
    """The one that was killed cannot name the fault any more; while the same one goes on, it is not told again."""
    desk.uptime_s = 7.0
    desk.go(0.02)
    desk.alive = False
    desk.go(0.15)
    desk.heard.clear()
    desk.alive, desk.uptime_s = True, 7.5
    desk.go(0.02)
    told = frames()[desk.frame_map.fault].id
    assert [m for m in desk.heard if m.arbitration_id == told] == []
    desk.uptime_s = 0.0
    desk.go(0.02)
    assert [m.arbitration_id for m in desk.heard].count(told) == 2


def test_safe_stop_of_another_drive_is_not_its_business(desk: Desk) -> None:
    desk.say("SafeStop", Target=desk.frame_map.target % 3 + 1, Reason=0)
    desk.go(0.01)
    assert desk.state == ENABLED
    desk.say("SafeStop", Target=0, Reason=0)
    desk.go(0.02)
    assert (desk.state, desk.drive.safe) == (STANDBY, True)


def test_warm_is_derated_and_hot_is_a_fault(desk: Desk) -> None:
    desk.drive.heated_to_C = 42.0
    desk.go(0.004)
    assert desk.state == DERATED
    desk.go(2 * HOT_S)
    assert desk.state == DERATED
    desk.drive.heated_to_C = 44.0
    desk.go(HOT_S + 0.01)
    assert (desk.state, desk.drive.stage.fault) == (FAULT, OVER_TEMPERATURE)


def test_a_controller_without_heartbeat_or_with_another_dbc_is_not_followed(desk: Desk) -> None:
    desk.say("ControllerHeartbeat", State=2, Uptime_s=0, Catalogue=(frames().fingerprint + 1) % 65536)
    desk.alive = False
    desk.say("Sync", Tick=desk.ticks, Period_s=TICK)
    desk.say(desk.frame_map.command, **desk.frame_map.values(0.0, 0.0, ENABLE))
    desk.go(TICK)
    assert (desk.state, desk.drive.stage.fault) == (FAULT, HEARTBEAT_LOST)


def test_a_boot_forgets_and_moves_nothing(desk: Desk) -> None:
    desk.drive.boot(desk.medium.now_s)
    assert (desk.state, desk.drive.stage.fault) == (BOOT, 0)
    desk.go(0.2)
    assert desk.state == STANDBY


def test_off_the_bus_is_latched(desk: Desk) -> None:
    desk.port.counters.transmit = 256
    desk.go(0.004)
    assert desk.state == FAULT
    desk.port.recover()
    desk.go(0.1)
    assert desk.state == FAULT


def test_what_was_recorded_never_enables(desk: Desk) -> None:
    """Every frame that a controller sent while it led, again at its own times: after the drive's boot, and after it has
    only come to stand by. Each time it asks for another number.
    """
    said: list[tuple[float, can.Message]] = []
    send = desk.bus.send
    desk.bus.send = lambda msg, timeout=None: (said.append((desk.now, msg)), send(msg, timeout))[1]  # type: ignore
    desk.drive.boot(desk.now)
    began = desk.now
    desk.enable()
    assert desk.state == ENABLED
    recording, desk.bus.send = list(said), send  # type: ignore[method-assign]
    desk.alive = desk.answers = False
    for boots in (True, False):
        desk.go(0.2)
        if boots:
            desk.drive.boot(desk.now)
        else:
            desk.say("DriveReset", Target=desk.frame_map.target, Code=desk.drive.stage.fault)
        shift, left = desk.now - began, list(recording)
        states = set()
        while left:
            while left and left[0][0] + shift <= desk.now + 1e-9:
                desk.bus.send(left.pop(0)[1])
            desk.go(TICK)
            states.add(desk.state)
        assert states <= {BOOT, SELF_TEST, STANDBY, FAULT}
        assert STANDBY in states
        assert desk.drive.power.at_rest


def test_a_live_sync_lets_no_other_time_in(desk: Desk) -> None:
    """One of a recording, whose ticks are others, and one that counts back are refused; the true one goes on."""
    refused = desk.drive.rejected
    sync = Sender(frames()["Sync"])
    for tick in (desk.ticks + 5000, 0):
        while sync._counter != (desk.senders["Sync"]._counter):
            sync.frame({"Tick": 0, "Period_s": TICK})
        data = sync.frame({"Tick": tick, "Period_s": TICK})
        desk.senders["Sync"].frame({"Tick": 0, "Period_s": TICK})
        desk.bus.send(can.Message(arbitration_id=frames()["Sync"].id, is_extended_id=False, data=data))
        desk.medium.advance(desk.now + 1e-4)
        desk.go(TICK)
    assert desk.drive.stale >= 2
    assert desk.drive.rejected > refused
    desk.go(0.02)
    assert desk.state == ENABLED


def test_other_types_of_frames_and_a_bus_that_raises_change_nothing(desk: Desk) -> None:
    """The right identifier, CRC and counter in an extended, remote, error or FD frame; garbled lines of a driver."""
    sender = desk.senders[desk.frame_map.command]
    data = sender.frame(desk.frame_map.values(0.0, 0.0, OFF))
    other: list[dict[str, bool]] = [{"is_extended_id": True}, {"is_error_frame": True}, {"is_fd": True}]
    told = [
        can.Message(
            timestamp=desk.now,
            arbitration_id=frames()[desk.frame_map.command].id,
            data=data,
            **{"is_extended_id": False, **kind},
        )
        for kind in other
    ]
    before = desk.drive.good_at
    desk.drive.bus = ScriptedBus(
        *told, None, ValueError("x"), IndexError(), UnicodeDecodeError("ascii", b"x", 0, 1, "?")
    )  # type: ignore[arg-type]
    for _ in range(6):
        desk.drive.listen(desk.now, 2)
    assert (desk.drive.strange, desk.drive.deaf, desk.drive.good_at) == (3, 3, before)
