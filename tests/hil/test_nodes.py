"""Drive nodes: the state machine, the power stages, what they do on the bus; and what the controller node hears."""

import math

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.limits import Limits
from hil.bus.protection import Sender
from hil.bus.sim import Medium, SimulatedBus
from hil.nodes.controller import FAULTY, HALTING, IDLE, RUNNING
from hil.nodes.doubts import Doubts
from hil.nodes.drive import HOT_S, DriveNode
from hil.nodes.drive_stage import (
    BOOT_S,
    BUS_OFF,
    HEARTBEAT_LOST,
    NO_FAULT,
    OVER_CURRENT,
    OVER_TEMPERATURE,
    SELF_TEST_S,
    TIME_TO_LIVE,
    Stage,
    Told,
    may_move,
    next_stage,
)
from hil.nodes.listening import Ears
from hil.nodes.power import CarriagePower, CoilPower, InnerMassPower, Power
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

TICK, SLOT = 2e-3, 1e-3
LEAD = (OFF, READY, ENABLE)


def test_numbers_are_those_of_the_dbc() -> None:
    """Modes, states, codes and targets by their names there."""
    catalogue = frames()
    for kind in ("magnetic", "coil", "vibro"):
        wiring = wiring_of(kind)
        command, feedback, fault = (catalogue[n] for n in (wiring.command, wiring.feedback, wiring.fault))
        modes = {"off": OFF, "ready": READY, "enable": ENABLE, "quick_stop": QUICK_STOP}
        assert {name: command.field("Mode").number(name) for name in modes} == modes
        states = {"boot": BOOT, "self_test": SELF_TEST, "standby": STANDBY, "ready": WAITING, "enabled": ENABLED}
        states |= {"derated": DERATED, "quick_stop": STOPPING, "fault": FAULT}
        assert {name: feedback.field("State").number(name) for name in states} == states
        codes = {"none": NO_FAULT, "over_current": OVER_CURRENT, "over_temperature": OVER_TEMPERATURE, "bus_off": BUS_OFF}
        codes |= {"time_to_live": TIME_TO_LIVE, "heartbeat_lost": HEARTBEAT_LOST}
        assert {name: fault.field("Code").number(name) for name in codes} == codes
        node = {"Carriage": "carriage", "Coil": "coil", "InnerMass": "inner_mass"}[wiring.node]
        assert catalogue["SafeStop"].field("Target").number(node) == wiring.target
        assert command.field(wiring.signal)
    beats = {"idle": IDLE, "running": RUNNING, "stopping": HALTING, "fault": FAULTY}
    assert {name: catalogue["ControllerHeartbeat"].field("State").number(name) for name in beats} == beats


def led(*modes: int, start: Stage | None = None, **more: object) -> Stage:
    """A drive that has been told `modes` one after the other, from standby."""
    stage = start or Stage(STANDBY)
    for mode in modes:
        stage = next_stage(stage, Told(mode, alive=True, **more), 1.0)  # type: ignore[arg-type]
    return stage


def test_boot_and_self_test_take_their_time() -> None:
    stage, states = Stage(), []
    for k in range(60):
        stage = next_stage(stage, Told(ENABLE, alive=True), k * SLOT)
        states.append(stage.state)
    assert states.index(SELF_TEST) == round(BOOT_S / SLOT)
    assert states.index(STANDBY) == round((BOOT_S + SELF_TEST_S) / SLOT)
    assert states[-1] == STANDBY


def test_only_off_ready_enable_in_turn_leads_up() -> None:
    assert led(*LEAD).state == ENABLED
    for modes in ((READY, ENABLE), (ENABLE,), (OFF, ENABLE), (OFF, QUICK_STOP, ENABLE), (READY, READY, ENABLE)):
        assert led(*modes).state in (STANDBY, WAITING)
        assert not may_move(led(*modes))


@pytest.mark.parametrize(
    ("told", "state"),
    [
        (Told(ENABLE, True), ENABLED),
        (Told(ENABLE, True, hot=True), DERATED),
        (Told(OFF, True, at_rest=False), STOPPING),
        (Told(READY, True), STOPPING),
        (Told(QUICK_STOP, True), STOPPING),
        (Told(ENABLE, True, safe_stop=True), STOPPING),
        (Told(ENABLE, False), FAULT),
        (Told(ENABLE, True, cause=OVER_CURRENT), FAULT),
    ],
)
def test_leaving_operation(told: Told, state: int) -> None:
    assert next_stage(led(*LEAD), told, 2.0).state == state
    assert next_stage(Stage(DERATED), told, 2.0).state == state


def test_a_stop_ends_in_standby_at_rest_and_needs_the_whole_way_up_again() -> None:
    stopping = next_stage(led(*LEAD), Told(QUICK_STOP, True, at_rest=False), 2.0)
    assert next_stage(stopping, Told(ENABLE, True, at_rest=False), 2.0).state == STOPPING
    rested = next_stage(stopping, Told(ENABLE, True), 2.0)
    assert rested == Stage(STANDBY, 2.0)
    assert led(READY, ENABLE, start=rested).state == STANDBY
    assert led(*LEAD, start=rested).state == ENABLED


@pytest.mark.parametrize("told", [Told(OFF, True), Told(READY, False), Told(READY, True, safe_stop=True), Told(QUICK_STOP, True)])
def test_ready_falls_back_to_standby(told: Told) -> None:
    assert next_stage(led(OFF, READY), told, 2.0) == Stage(STANDBY, 2.0)


@given(
    told=st.lists(
        st.builds(
            Told,
            mode=st.integers(0, 3),
            alive=st.booleans(),
            safe_stop=st.booleans(),
            reset=st.sampled_from([0, 1, 2, TIME_TO_LIVE, 5]),
            cause=st.sampled_from([0, 0, 0, 1, 2, 5]),
            hot=st.booleans(),
            at_rest=st.booleans(),
        ),
        max_size=40,
    )
)
def test_no_way_around_the_order(told: list[Told]) -> None:
    """A latched fault ends only by its own reset with its cause gone, in standby; operation begins only from ready by a live enable."""
    stage = Stage(STANDBY)
    for k, one in enumerate(told):
        after = next_stage(stage, one, float(k))
        if stage.state == FAULT and after.state != FAULT:
            assert after.state == STANDBY
            assert (one.reset, one.cause, one.at_rest) == (stage.fault, 0, True)
            assert not after.armed
        if may_move(after) and not may_move(stage):
            assert stage.state == WAITING
            assert (one.mode, one.alive, one.safe_stop, one.cause) == (ENABLE, True, False, 0)
        if may_move(after):
            assert (one.alive, one.safe_stop, one.mode) == (True, False, ENABLE)
        assert (after.fault > 0) == (after.state == FAULT)
        stage = after


def test_carriage_reaches_each_setpoint_in_a_tick_and_brakes_within_25_ms() -> None:
    power = CarriagePower(0.25, 1.0)
    power.aim(4e-4, TICK)
    assert [power.step(SLOT, 1.0, 0.0), power.step(SLOT, 1.0, 0.0)] == pytest.approx([2e-4, 4e-4])
    power.aim(1.0, TICK)
    power.step(SLOT, 1.0, 0.0)
    assert power.rate == 0.25
    stood = 0
    while not power.at_rest:
        power.step(SLOT, 0.0, 0.0)
        stood += 1
    assert stood * SLOT <= 0.011
    here = power.output
    assert power.step(SLOT, 1.0, 0.0) == here
    power.aim(-5.0, TICK)
    for _ in range(9000):
        power.step(SLOT, 0.5, 0.0)
        assert abs(power.rate) <= 0.125
    assert power.output == -1.0


def test_coil_current_follows_and_is_gone_within_two_milliseconds() -> None:
    """An R-L coil under the current loop: 1 % after three milliseconds, below 1 % of the limit within two after the stop."""
    r, inductance, dt, i = 10.4, 10e-3, 0.5e-3, 0.0
    power = CoilPower(1.0, 10.0, inductance)

    def go(share: float, steps: int) -> None:
        nonlocal i
        for _ in range(steps):
            u = power.step(dt, share, i)
            i = u / r + (i - u / r) * math.exp(-dt * r / inductance)
            assert abs(u) <= power.supply_V

    power.aim(0.8, TICK)
    go(1.0, 10)
    assert i == pytest.approx(0.8, rel=0.01)
    go(0.5, 20)
    assert i == pytest.approx(0.5, rel=0.01)
    assert not power.at_rest
    go(0.0, 4)
    power.step(dt, 0.0, i)
    assert power.at_rest
    power.step(dt, 1.0, 1.31)
    assert power.overload


def test_inner_mass_is_off_at_once() -> None:
    power = InnerMassPower()
    power.aim(0.7, TICK)
    assert power.step(SLOT, 1.0, 1e-3) == 0.7
    assert power.step(SLOT, 0.5, 1e-3) == 0.5
    assert power.step(SLOT, 0.0, 1e-3) == 0.0
    assert power.at_rest
    assert power.step(SLOT, 1.0, 1e-3) == 0.0


class Desk:
    """A drive on a bus and a hand that sends it frames."""

    def __init__(self, kind: str, power: Power) -> None:
        self.medium = Medium()
        self.bus = SimulatedBus(self.medium, "Hand")
        self.wiring = wiring_of(kind)
        self.port = SimulatedBus(self.medium, "Drive")
        self.drive = DriveNode(self.port, frames(), self.wiring, power, Limits(), TICK)
        self.senders = {f.name: Sender(f) for f in frames().frames.values()}
        self.now, self.mode, self.value = 0.0, OFF, 0.0
        self.alive, self.uptime_s = True, 0.0
        self.heard: list[can.Message] = []

    def say(self, name: str, **values: float) -> None:
        data = self.senders[name].frame(values)
        self.bus.send(can.Message(arbitration_id=frames()[name].id, is_extended_id=False, data=data))

    def go(self, seconds: float) -> None:
        """Ticks as a controller makes them, as long as it is alive."""
        for _ in range(round(seconds / TICK)):
            if self.alive:
                self.say("Sync", Tick=0, Period_s=TICK)
                self.say("ControllerHeartbeat", State=2, Uptime_s=self.uptime_s, Catalogue=frames().fingerprint)
                self.say(self.wiring.command, **self.wiring.values(self.value, 0.0, self.mode))
            for k in range(2):
                self.medium.advance(self.now + 2e-4 + k * SLOT)
                self.drive.listen(self.medium.now_s, 2)
                self.drive.output(SLOT, self.drive.power.output)
            self.now += TICK
            self.medium.advance(self.now)
            while (message := self.bus.recv(0)) is not None:
                self.heard.append(message)

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
    told = [m for m in desk.heard if m.arbitration_id == frames()[desk.wiring.fault].id]
    assert len(told) == 2
    desk.alive = True
    desk.go(0.1)
    assert desk.state == FAULT
    desk.say("DriveReset", Target=desk.wiring.target, Code=OVER_CURRENT)
    desk.go(0.01)
    assert desk.state == FAULT
    desk.say("DriveReset", Target=desk.wiring.target, Code=TIME_TO_LIVE)
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
    told = frames()[desk.wiring.fault].id
    assert [m for m in desk.heard if m.arbitration_id == told] == []
    desk.uptime_s = 0.0
    desk.go(0.02)
    assert [m.arbitration_id for m in desk.heard].count(told) == 2


def test_safe_stop_of_another_drive_is_not_its_business(desk: Desk) -> None:
    desk.say("SafeStop", Target=desk.wiring.target % 3 + 1, Reason=0)
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
    desk.say("Sync", Tick=0, Period_s=TICK)
    desk.say(desk.wiring.command, **desk.wiring.values(0.0, 0.0, ENABLE))
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


def test_ears_take_good_frames_and_their_age() -> None:
    medium = Medium()
    own, other = SimulatedBus(medium, "Controller"), SimulatedBus(medium, "Other")
    seen: list[can.Message] = []
    ears = Ears(own, frames(), wiring_of("magnetic"), TICK, seen.append)
    place, feed = Sender(frames()["CapsuleLocalisation"]), Sender(frames()["CarriageFeedback"])

    def send(name: str, data: bytes) -> None:
        other.send(can.Message(arbitration_id=frames()[name].id, is_extended_id=False, data=data))

    assert ears.evidence(0.0).localisation_s == math.inf
    send("CapsuleLocalisation", place.frame({"Position_m": 0.1, "Quality": 1, "Age_s": 0.008, "Valid": 1}))
    send("CarriageFeedback", feed.frame({"Position_m": 0.05, "Velocity_m_s": 0, "State": ENABLED, "Temperature_degC": 30}))
    other.send(can.Message(arbitration_id=0x7FF, is_extended_id=False, data=bytes(8)))
    medium.advance(0.01)
    found = {m.channel: m for m in ears.listen(0.01)}
    assert found["position_m"].value == pytest.approx(0.1)
    assert found["position_m"].stamp_s == pytest.approx(-0.008, abs=4e-4)
    assert found["carriage_position_m"].stamp_s == pytest.approx(0.0)
    assert (ears.state, ears.temperature_C, ears.report) == (ENABLED, 30.0, pytest.approx(0.05))
    assert (ears.rejected, len(seen)) == (1, 3)
    send("CapsuleLocalisation", place.frame({"Position_m": 0.1, "Quality": 0, "Age_s": 0, "Valid": 0}))
    bad = bytearray(feed.frame({"Position_m": 0.06, "Velocity_m_s": 0, "State": FAULT, "Temperature_degC": 30}))
    bad[4] ^= 4
    send("CarriageFeedback", bytes(bad))
    medium.advance(0.02)
    assert ears.listen(0.02) == []
    assert (ears.state, ears.rejected) == (ENABLED, 2)
    assert ears.evidence(0.02).localisation_s == pytest.approx(0.028, abs=5e-4)


def test_doubts() -> None:
    doubts = Doubts(1e-3)
    for value in (0.1, 0.2, 0.2, 0.3, 0.3, 0.3):
        assert doubts.reason(0) == ""
        doubts.saw(value)
    assert doubts.reason(0) == "localisation stuck"
    doubts.saw(0.4)
    for k in range(5):
        assert doubts.reason(0) == ""
        doubts.reported(0.0, math.nan if k == 2 else 2e-3)
    assert doubts.reason(0) == "drive does not follow"
    doubts.reported(0.0, 1e-3)
    assert (doubts.reason(0), doubts.reason(1)) == ("", "localisation jumped")
    doubts.settle(1)
    assert doubts.reason(1) == ""
    for told in (0.0, 4e-5, 6e-5, 7e-5, 8e-5, 9e-5):
        doubts.reported(5e-7, told)
        assert doubts.reason(1) == ""
    doubts.reported(5e-7, 1e-4)
    assert doubts.reason(1) == "drive does not follow"
    doubts.reported(1e-7, 2e-4)
    assert doubts.reason(1) == ""
    coarse = Doubts(1e-3, noisy=False)
    for _ in range(9):
        coarse.saw(0.1)
    assert coarse.reason(0) == ""
