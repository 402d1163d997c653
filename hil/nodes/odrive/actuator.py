"""An ODrive as the catalogue's carriage, over CANSimple: states, mapping, limits, safe state, and its watchdog, read
back before anything moves. Source: the maker's CAN protocol page and DBC of firmware 0.6.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import can

from controller.limits import Limits
from hil.bus.catalogue import Catalogue
from hil.nodes.carriage_bus import IDLE_TICKS, BrakePath, CarriageBus
from hil.nodes.drive.state_machine import OVER_CURRENT, OVER_TEMPERATURE, TIME_TO_LIVE
from hil.nodes.frame_map import (
    BOOT,
    ENABLE,
    ENABLED,
    FAULT,
    READY,
    STANDBY,
    STOPPING,
    WAITING,
    frames,
    plain,
)
from hil.nodes.listening import heard_for, silent
from hil.nodes.turning import Turning

GET_VERSION, HEARTBEAT, GET_ERROR, RX_SDO, TX_SDO, SET_AXIS_STATE = 0x00, 0x01, 0x03, 0x04, 0x05, 0x07
GET_ENCODER_ESTIMATES, SET_CONTROLLER_MODE, SET_INPUT_POS, SET_LIMITS = 0x09, 0x0B, 0x0C, 0x0F
CLEAR_ERRORS, SET_ABSOLUTE_POSITION = 0x18, 0x19
"""Commands: the 5 lower bits of an identifier, whose 6 upper ones are the node."""
_SAID: Final = MappingProxyType(
    {
        HEARTBEAT: ("CarriageHeartbeat", 5),
        GET_ERROR: ("CarriageFault", 8),
        GET_ENCODER_ESTIMATES: ("CarriageFeedback", 8),
    }
)
"""What becomes of its frames, and how long they are at least."""
_TOLD: Final = (GET_VERSION, HEARTBEAT, GET_ERROR, TX_SDO, GET_ENCODER_ESTIMATES, 0x14, 0x15, 0x17, 0x1C, 0x1D)
"""Those by which the drive speaks, asked or unasked."""
IDLE, CLOSED_LOOP = 1, 8
"""Axis states; every other one is on the way to one of them or a calibration."""
POSITION_CONTROL, PASSTHROUGH = 3, 1
HEARTBEAT_S: Final = 0.02
LISTEN_S: Final = 0.3
_INITIALIZING: Final = 1
_ASK_TICKS: Final = 10
_GIVE_UP_TICKS: Final = 250
_FORGIVEN: Final = 2
_OVER_SPEED, _SENSOR, _SUPPLY, _INTERNAL = 3, 7, 9, 11
ERRORS: Final[Mapping[int, tuple[str, int]]] = MappingProxyType(
    {
        0x2: ("SYSTEM_LEVEL", _INTERNAL),
        0x4: ("TIMING_ERROR", _INTERNAL),
        0x8: ("MISSING_ESTIMATE", _SENSOR),
        0x10: ("BAD_CONFIG", _INTERNAL),
        0x20: ("DRV_FAULT", _INTERNAL),
        0x40: ("MISSING_INPUT", _INTERNAL),
        0x100: ("DC_BUS_OVER_VOLTAGE", _SUPPLY),
        0x200: ("DC_BUS_UNDER_VOLTAGE", _SUPPLY),
        0x400: ("DC_BUS_OVER_CURRENT", OVER_CURRENT),
        0x800: ("DC_BUS_OVER_REGEN_CURRENT", OVER_CURRENT),
        0x1000: ("CURRENT_LIMIT_VIOLATION", OVER_CURRENT),
        0x2000: ("MOTOR_OVER_TEMP", OVER_TEMPERATURE),
        0x4000: ("INVERTER_OVER_TEMP", OVER_TEMPERATURE),
        0x8000: ("VELOCITY_LIMIT_VIOLATION", _OVER_SPEED),
        0x10000: ("POSITION_LIMIT_VIOLATION", _INTERNAL),
        0x1000000: ("WATCHDOG_TIMER_EXPIRED", TIME_TO_LIVE),
        0x2000000: ("ESTOP_REQUESTED", _INTERNAL),
        0x4000000: ("SPINOUT_DETECTED", _SENSOR),
        0x8000000: ("BRAKE_RESISTOR_DISARMED", _SUPPLY),
        0x10000000: ("THERMISTOR_DISCONNECTED", _SENSOR),
        0x40000000: ("CALIBRATION_ERROR", _SENSOR),
    }
)
"""The bits of an axis error: its name, and the catalogue's code of a fault."""


@dataclass(frozen=True)
class OdriveTable(Turning):
    """`[odrive]`: the carriage is an ODrive of this `node_id`, whose motor does `turns_per_m` (negative: the other
    way). `firmware` and the two endpoint ids, of `flat_endpoints.json` of that firmware, are what its watchdog is read
    back by; that one must expire within `watchdog_s`. `coast_m_s2` is the deceleration of the carriage without torque,
    which is its safe state. `home` "here" makes the present place zero. `answers_s`: how long it may take to be found.
    """

    node_id: int = 2
    turns_per_m: float = 100.0
    firmware: str = "0.6.11"
    enable_watchdog_endpoint: int = 0
    watchdog_timeout_endpoint: int = 0
    watchdog_s: float = 0.02
    motor_current_A: float = 10.0
    coast_m_s2: float = 5.0
    home: str = "kept"
    answers_s: float = 2.0

    def __post_init__(self) -> None:
        if self.node_id not in FREE_NODES:
            free = ", ".join(map(str, FREE_NODES))
            raise ValueError(
                f"odrive.node_id must be one of {free}, clear of the catalogue's identifiers; got {self.node_id}"
            )
        self.check("odrive", RANGES)

    def orders(self, message: can.Message) -> bool:
        """Whether `message` is one by which a master commands this drive; to read an endpoint is a question."""
        node, command = message.arbitration_id >> 5, message.arbitration_id & 0x1F
        if not plain(message) or node != self.node_id or command in _TOLD:
            return False
        return command != RX_SDO or bytes(message.data[:1]) != b"\0"


RANGES: Final = (
    ("turns_per_m", 1.0, 1e5),
    ("enable_watchdog_endpoint", 0, 65535),
    ("watchdog_timeout_endpoint", 0, 65535),
    ("watchdog_s", 0.004, 0.1),
    ("motor_current_A", 0.1, 200.0),
    ("coast_m_s2", 0.1, 100.0),
    ("answers_s", 0.1, 60.0),
)
FREE_NODES: Final = tuple(n for n in range(64) if n not in {frame.id >> 5 for frame in frames().frames.values()})
"""Nodes none of whose 32 identifiers is one of the catalogue's."""


def words_of(errors: int) -> str:
    """The names of the bits of an axis error."""
    known = [name for bit, (name, _) in ERRORS.items() if errors & bit]
    rest = errors & ~(_INITIALIZING | sum(ERRORS))
    return ", ".join([*known, *([f"error 0x{rest:X}"] if rest else [])])


def code_of(errors: int) -> int:
    """The catalogue's code of a fault."""
    return next((code for bit, (_, code) in ERRORS.items() if errors & bit), _INTERNAL)


class OdriveBus(CarriageBus):
    """A command leaves with the SYNC after it as Set_Input_Pos, which feeds the drive's watchdog; its encoder estimates
    come in as feedback, its heartbeats as heartbeats, an error as a fault.

    "Ready" is told of an idle axis without errors once it is asked for; "enable" then asks for closed loop control. To
    stop, the carriage is braked by positions (`BrakePath`) and the axis then made idle. An error, and a reason
    for which the axis disarmed itself, is latched until it is acknowledged, though the drive may forget it before.
    """

    def __init__(self, inner: can.BusABC, table: OdriveTable, catalogue: Catalogue, tick_s: float) -> None:
        super().__init__(inner, f"ODrive node {table.node_id}", catalogue, table.orders)
        self.table, self._tick_s = table, tick_s
        self._axis, self._errors, self._latched, self._forgiven = 0, 0, 0, 0
        self._turns = self._turns_s = 0.0
        self._wanted_m, self._fresh, self._mode = 0.0, False, 0
        self._armed = self._led = False
        self._asked = self._stopped = 0
        self._last_m = self._rate_m_s = math.nan
        self._braking = BrakePath(tick_s)
        self._heard_at, self._others_at, self._others = -math.inf, -math.inf, set[int]()
        self._left = ""

    @property
    def trouble(self) -> str:
        """Errors by name, a reboot, or other nodes that speak while this one is silent."""
        silent = self._others_at - self._heard_at > 5 * HEARTBEAT_S
        others = f"silent, but node {', '.join(map(str, sorted(self._others)))} speaks" if silent else ""
        told = [words for words in (words_of(self._latched), self._left, others) if words]
        return f"odrive node {self.table.node_id}: {'; '.join(told)}" if told else ""

    @property
    def shown(self) -> int:
        """The axis' state in the catalogue's numbers."""
        if self._latched:
            return FAULT
        if self._axis == CLOSED_LOOP:
            return ENABLED if self._armed else STOPPING
        if self._axis == IDLE and not self._errors:
            return WAITING if self._armed else STANDBY
        return BOOT

    def command(self, mode: int, place_m: float, timeout: float | None) -> None:
        """Held until the next SYNC; what stops the drive acts at once."""
        self._mode = mode
        if mode == ENABLE and self._armed:
            self._wanted_m, self._fresh = place_m, True
        elif mode == READY and self.shown == STANDBY:
            self._armed, self._led, self._asked, self._left = True, False, 0, ""
            self._last_m, self._stopped = math.nan, 0
        elif mode not in (READY, ENABLE):
            self._armed = False
        if not self._armed and self._axis == CLOSED_LOOP:
            self._brake(timeout)

    def synchronise(self, timeout: float | None) -> None:
        """Send the newest command, once; ask for closed loop control where the axis is still idle."""
        fresh, self._fresh = self._fresh, False
        if not fresh or not self._armed:
            return
        begin = self._wanted_m if self._asked or math.isnan(self._last_m) else self._last_m
        self._rate_m_s = (self._wanted_m - begin) / self._tick_s
        self._last_m = self._wanted_m
        self._braking.leave()
        if self._axis != CLOSED_LOOP:
            if self._asked % _ASK_TICKS == 0:
                self._tell(SET_AXIS_STATE, struct.pack("<I", CLOSED_LOOP), timeout)
            self._asked += 1
            if self._asked > _GIVE_UP_TICKS:
                self._armed, self._left = False, "it did not enter closed loop control"
        self._place(self._wanted_m, self._rate_m_s, timeout)

    def acknowledge(self, timeout: float | None) -> None:
        """Clear_Errors; what is still wrong then is latched again."""
        self._latched, self._forgiven, self._left = 0, _FORGIVEN, ""
        self._tell(CLEAR_ERRORS, b"\0", timeout)

    def live(self, timeout: float | None) -> None:
        """Ask for the reason of a disarming: the error itself may be gone before a heartbeat tells it."""
        self._tell(GET_ERROR, b"", timeout)

    def halt(self, timeout: float | None) -> None:
        """Brake, with the next command: there is one a tick."""
        self._armed = False

    def take(self, message: can.Message) -> bool:
        """The node's frames; that other nodes speak is remembered."""
        node, command, data = message.arbitration_id >> 5, message.arbitration_id & 0x1F, bytes(message.data)
        if not plain(message) or node not in FREE_NODES:
            return False
        if node != self.table.node_id:
            if command == HEARTBEAT and len(data) == 8:
                self._others_at = message.timestamp
                self._others.add(node)
            return False
        self._heard_at = message.timestamp
        name, least = _SAID.get(command, ("", 0))
        if len(data) < least and not (command == GET_ERROR and not data):
            self.refuse(name, message)
        elif command == HEARTBEAT:
            self._beaten(data, message.timestamp)
        elif command == GET_ERROR and data:
            self._failed(struct.unpack_from("<II", data), message.timestamp)
        elif command == GET_ENCODER_ESTIMATES:
            self._turns, self._turns_s = struct.unpack_from("<ff", data)
            scale = self.table.turns_per_m
            self.feed(self.shown, self._turns / scale, self._turns_s / scale, message.timestamp)
        return True

    def _beaten(self, data: bytes, stamp: float) -> None:
        """A heartbeat: axis error and state."""
        errors, axis = struct.unpack_from("<IB", data)
        anew = bool(errors & _INITIALIZING) or axis == 0
        if self._led and (anew or (self._armed and axis == IDLE)):
            self._armed = self._led = False
            self._left = "it booted anew" if anew else "it left closed loop control by itself"
        self._axis, self._errors = axis, errors
        self._led = self._led or (self._armed and axis == CLOSED_LOOP)
        self._asked = 0 if axis == CLOSED_LOOP else self._asked
        self._failed((errors & ~_INITIALIZING, 0), stamp)
        self._forgiven = max(self._forgiven - 1, 0)
        self.beat(self.shown, stamp, anew=anew)

    def _failed(self, told: tuple[int, int], stamp: float) -> None:
        """Active errors and the reason of a disarming: latched, and told where they are new."""
        errors = told[0] | told[1]
        if not errors or self._forgiven:
            return
        before, self._latched = self._latched, self._latched | errors
        if not before:
            self._armed, self._left = False, ""
            self.fail(code_of(errors), errors.bit_length() - 1, stamp)

    def _brake(self, timeout: float | None) -> None:
        """A step of the way to rest; at rest the axis is made idle. Where it does not become idle, silence leaves it to
        its watchdog.
        """
        scale = self.table.turns_per_m
        led = not math.isnan(self._last_m)
        onward = (self._last_m, self._rate_m_s) if led else (self._turns / scale, self._turns_s / scale)
        step = self._braking.step(*onward)
        if step is not None:
            self._place(*step, timeout)
        elif self._stopped < IDLE_TICKS:
            self._stopped += 1
            self._tell(SET_AXIS_STATE, struct.pack("<I", IDLE), timeout)

    def _place(self, place_m: float, rate_m_s: float, timeout: float | None) -> None:
        """Set_Input_Pos: position, and its rate in thousandths of a turn a second."""
        scale = self.table.turns_per_m
        ahead = round(1e3 * rate_m_s * scale)
        self._tell(SET_INPUT_POS, struct.pack("<fhh", place_m * scale, min(max(ahead, -32768), 32767), 0), timeout)

    def _tell(self, command: int, data: bytes, timeout: float | None) -> None:
        self.say(self.table.node_id << 5 | command, data, timeout)


def set_up(bus: can.BusABC, table: OdriveTable, limits: Limits, tick_s: float) -> None:
    """Find the drive, read its watchdog back, see that it reports often enough, and give it mode and limits; it stays
    idle. Blocks, at most some seconds. Nothing is written to its configuration.

    Raises ValueError of one sentence where no drive answers, it may not be left alone, or it is not as it must be.
    """
    ask = _Questions(bus, table)
    version = ask.reply(GET_VERSION, b"", GET_VERSION, lambda data: len(data) == 8)
    firmware = ".".join(map(str, version[4:7]))
    node = f"odrive: node {table.node_id}"
    if firmware != table.firmware:
        raise ValueError(
            f"{node} must have the firmware {table.firmware} of odrive.firmware, whose endpoint ids are stated; got"
            f" {firmware}"
        )
    _check_watchdog(ask, table, node)
    beats, places, axis = ask.cycles(LISTEN_S)
    if axis == CLOSED_LOOP:
        raise ValueError(f"{node} must be idle before it is led; got closed loop control, by somebody else")
    if beats < 0.8 * LISTEN_S / HEARTBEAT_S:
        raise ValueError(
            f"{node} must send a heartbeat every {1e3 * HEARTBEAT_S:g} ms (can.heartbeat_msg_rate_ms); got {beats} in"
            f" {LISTEN_S:g} s"
        )
    if places < 0.8 * LISTEN_S / (2 * tick_s):
        raise ValueError(
            f"{node} must send its encoder estimates every {2e3 * tick_s:g} ms (can.encoder_msg_rate_ms); got"
            f" {places} in {LISTEN_S:g} s"
        )
    ask.tell(SET_CONTROLLER_MODE, struct.pack("<II", POSITION_CONTROL, PASSTHROUGH))
    fastest = abs(table.turns_per_m) * limits.carriage_speed_m_s
    ask.tell(SET_LIMITS, struct.pack("<ff", fastest, table.motor_current_A))
    if table.home == "here":
        ask.tell(SET_ABSOLUTE_POSITION, struct.pack("<f", 0.0))


def _check_watchdog(ask: _Questions, table: OdriveTable, node: str) -> None:
    """Its watchdog must be on, and short enough."""
    if not table.enable_watchdog_endpoint or not table.watchdog_timeout_endpoint:
        raise ValueError(
            f"{node}'s watchdog must be read back before anything moves: odrive.enable_watchdog_endpoint and"
            " odrive.watchdog_timeout_endpoint must be the ids of axis0.config.enable_watchdog and watchdog_timeout in"
            " its firmware's flat_endpoints.json; a firmware before 0.6 cannot be asked over CAN"
        )
    on = ask.endpoint(table.enable_watchdog_endpoint, "<?")
    timeout = ask.endpoint(table.watchdog_timeout_endpoint, "<f")
    if not on:
        raise ValueError(f"{node}'s watchdog must be on (axis0.config.enable_watchdog = True); it is off")
    if not 0 < timeout <= table.watchdog_s * (1 + 1e-6):
        raise ValueError(
            f"{node}'s watchdog must expire within {table.watchdog_s:g} s (axis0.config.watchdog_timeout); got"
            f" {timeout:g}"
        )


class _Questions:
    """Questions to the drive and its answers, before the controller listens."""

    def __init__(self, bus: can.BusABC, table: OdriveTable) -> None:
        self._bus, self._table = bus, table
        self._errors, self._others = 0, set[int]()

    def tell(self, command: int, data: bytes) -> None:
        """Send one frame. Raises ValueError where the bus does not take it."""
        identifier = self._table.node_id << 5 | command
        try:
            self._bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data), timeout=0.1)
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            raise ValueError(f"odrive: node {self._table.node_id} must be reached; got: {error}") from None

    def reply(self, command: int, data: bytes, answer: int, fits: Callable[[bytes], bool]) -> bytes:
        """The data of the frame that answers, asked for again each 0.1 s."""
        end = time.monotonic() + self._table.answers_s
        while time.monotonic() < end:
            self.tell(command, data)
            for told, got in self._hear(0.1):
                if told == answer and fits(got):
                    return got
        causes = "bit rate, wiring, termination", "supply, wiring, bit rate"
        node = f"odrive: node {self._table.node_id}"
        raise silent(node, self._table.answers_s, self._others, self._errors, causes)

    def endpoint(self, number: int, kind: str) -> float:
        """The value of an endpoint, read over SDO."""

        def fits(data: bytes) -> bool:
            told = struct.unpack_from("<BHB", data)[1] if len(data) >= 4 else -1
            return told == number and len(data) >= 4 + struct.calcsize(kind)

        data = self.reply(RX_SDO, struct.pack("<BHB", 0, number, 0), TX_SDO, fits)
        return float(struct.unpack_from(kind, data, 4)[0])

    def cycles(self, seconds: float) -> tuple[int, int, int]:
        """How many heartbeats and encoder estimates come within `seconds`, and the axis state told last."""
        beats, places, axis = 0, 0, 0
        for command, data in self._hear(seconds):
            beats += command == HEARTBEAT
            places += command == GET_ENCODER_ESTIMATES
            axis = data[4] if command == HEARTBEAT and len(data) >= 5 else axis
        return beats, places, axis

    def _hear(self, seconds: float) -> list[tuple[int, bytes]]:
        """The node's frames within `seconds`, until an answer may be among them."""
        found = list[tuple[int, bytes]]()
        for message in heard_for(self._bus, seconds):
            self._errors += message.is_error_frame
            if not plain(message):
                continue
            node, command = message.arbitration_id >> 5, message.arbitration_id & 0x1F
            if node == self._table.node_id:
                found.append((command, bytes(message.data)))
            elif command == HEARTBEAT and node in FREE_NODES and len(message.data) == 8:
                self._others.add(node)
        return found
