"""A moteus controller as the catalogue's carriage, over CAN FD: states, mapping, limits, safe state, and its watchdog,
sent with every command and read back with every reply. Source: the maker's register reference.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import can

from hil.bus.catalogue import Catalogue
from hil.nodes.carriage_bus import IDLE_TICKS, BrakePath, CarriageBus
from hil.nodes.drive.state_machine import OVER_CURRENT, OVER_TEMPERATURE, TIME_TO_LIVE
from hil.nodes.frame_map import BOOT, ENABLE, ENABLED, FAULT, READY, STANDBY, STOPPING, WAITING
from hil.nodes.listening import heard_for, silent
from hil.nodes.moteus import registers as wire
from hil.nodes.turning import Turning

BRAKING_MODES: Final = (10, 12, 15)
"""Values of servo.timeout_mode by which it brakes: hold position, zero velocity, phases shorted."""
_BEAT_S: Final = 0.015
_FORGIVEN: Final = 3
_GIVE_UP_TICKS: Final = 250
_SILENT_S: Final = 0.012
"""A drive that was led and then is silent for so long may have booted anew, and must not be led on unawares."""
_SENSOR, _SUPPLY, _SELF_TEST, _INTERNAL = 7, 9, 10, 11
FAULTS: Final[Mapping[int, tuple[str, int]]] = MappingProxyType(
    {
        32: ("calibration fault", _SENSOR),
        33: ("motor driver fault", OVER_CURRENT),
        34: ("over voltage", _SUPPLY),
        35: ("encoder fault", _SENSOR),
        36: ("motor not configured", _SELF_TEST),
        37: ("pwm cycle overrun", _INTERNAL),
        38: ("over temperature", OVER_TEMPERATURE),
        39: ("outside limit", _INTERNAL),
        40: ("under voltage", _SUPPLY),
        41: ("config changed", _INTERNAL),
        42: ("theta invalid", _SENSOR),
        43: ("position invalid", _SENSOR),
        44: ("driver enable fault", _INTERNAL),
        45: ("stop position deprecated", _INTERNAL),
        46: ("timing violation", _INTERNAL),
        47: ("bemf feedforward no accel", _INTERNAL),
        48: ("invalid limits", _INTERNAL),
        49: ("position control error", _INTERNAL),
        50: ("velocity control error", _INTERNAL),
    }
)
"""Fault codes of mode 1: names, and the catalogue's code of a fault. Codes from 96 on only tell a limit at work."""
_WATCHDOG: Final = ("watchdog expired (mode 11, timeout)", TIME_TO_LIVE)


@dataclass(frozen=True)
class MoteusTable(Turning):
    """`[moteus]`: the carriage is a moteus controller of this `node_id`, whose output does `turns_per_m` (negative: the
    other way) with at most `most_torque_N_m`. Each command is worth something for `watchdog_s`. `coast_m_s2` is the
    deceleration of the carriage without torque, as after a fault. `home` "here" makes the present place zero.
    `answers_s`: how long it may take to be found.
    """

    node_id: int = 1
    turns_per_m: float = 100.0
    most_torque_N_m: float = 0.5
    watchdog_s: float = 0.02
    coast_m_s2: float = 5.0
    home: str = "kept"
    answers_s: float = 2.0

    def __post_init__(self) -> None:
        self.check("moteus", RANGES)

    def orders(self, message: can.Message) -> bool:
        """Whether `message` is one by which a master commands this drive."""
        return wire.orders(message, self.node_id)


RANGES: Final = (
    ("node_id", 1, 126),
    ("turns_per_m", 1.0, 1e5),
    ("most_torque_N_m", 0.001, 100.0),
    ("watchdog_s", 0.004, 0.1),
    ("coast_m_s2", 0.1, 100.0),
    ("answers_s", 0.1, 60.0),
)


class MoteusBus(CarriageBus):
    """A command leaves with the SYNC after it as position mode with its own watchdog; every SYNC asks mode, place,
    speed, fault and the watchdog that the drive holds, and the reply comes in as feedback and heartbeat.

    "Ready" is told once the stopped drive has taken the watchdog and told it back; "enable" then begins position mode.
    To stop, the carriage is braked by positions (`BrakePath`) and the drive then stopped. "Stopped" clears a fault of
    this drive, so none is sent while one is latched, until that is acknowledged.
    """

    def __init__(self, inner: can.BusABC, table: MoteusTable, catalogue: Catalogue, tick_s: float) -> None:
        super().__init__(inner, f"moteus node {table.node_id}", catalogue, table.orders)
        self.table, self._tick_s = table, tick_s
        self._watchdog_s = struct.unpack("<f", struct.pack("<f", table.watchdog_s))[0]
        self._servo, self._held_s = -1, math.nan
        self._place_m = self._speed_m_s = 0.0
        self._wanted_m, self._fresh = 0.0, False
        self._last_m = self._rate_m_s = math.nan
        self._armed = self._led = False
        self._asked, self._stopped, self._forgiven, self._unanswered = 0, 0, 0, 0
        self._latched, self._left = "", ""
        self._braking = BrakePath(tick_s)
        self._beat_at = -math.inf

    @property
    def trouble(self) -> str:
        """The fault by name, or how it left position mode."""
        told = self._latched or self._left
        return f"moteus node {self.table.node_id}: {told}" if told else ""

    @property
    def shown(self) -> int:
        """The drive's mode in the catalogue's numbers."""
        if self._latched:
            return FAULT
        if self._servo == wire.STOPPED:
            return WAITING if self._armed and self._held_s == self._watchdog_s else STANDBY
        if self._servo == wire.POSITION_MODE:
            return ENABLED if self._armed else STOPPING
        return WAITING if self._armed and 2 <= self._servo <= 4 else STOPPING if self._servo >= 0 else BOOT

    def command(self, mode: int, place_m: float, timeout: float | None) -> None:
        """Held until the next SYNC; what stops the drive acts at once."""
        if mode == ENABLE and self._armed:
            self._wanted_m, self._fresh = place_m, True
        elif mode == READY and self.shown == STANDBY:
            self._armed, self._led, self._asked, self._left = True, False, 0, ""
            self._last_m, self._stopped = math.nan, 0
        elif mode not in (READY, ENABLE):
            self._armed = False
        if not self._armed:
            self._rest(timeout)

    def synchronise(self, timeout: float | None) -> None:
        """One frame a tick: the newest command, once; the watchdog for a drive that is to become ready; else a
        question.
        """
        fresh, self._fresh = self._fresh, False
        self._unanswered += 1
        if self._armed and self._led and self._unanswered * self._tick_s > _SILENT_S:
            self._armed, self._left = False, "silent"
        if self._armed and fresh:
            self._braking.leave()
            self._lead(timeout)
        elif self._armed and self._servo == wire.STOPPED and self._held_s != self._watchdog_s:
            held = wire.write(wire.WATCHDOG_TIMEOUT, (self.table.watchdog_s,))
            self._tell(wire.mode_write(wire.STOPPED) + held + wire.QUERY, timeout)
        else:
            self._tell(wire.QUERY, timeout)

    def acknowledge(self, timeout: float | None) -> None:
        """Stop, which clears a fault; what is still wrong then is latched again."""
        self._latched, self._left, self._forgiven = "", "", _FORGIVEN
        self._tell(wire.mode_write(wire.STOPPED), timeout)

    def halt(self, timeout: float | None) -> None:
        """Brake, with the next command: there is one a tick."""
        self._armed = False

    def take(self, message: can.Message) -> bool:
        """The node's replies."""
        if wire.replier(message) != self.table.node_id:
            return False
        values = wire.told(bytes(message.data))
        if wire.MODE in values and math.isfinite(values[wire.MODE]):
            self._replied(values, message.timestamp)
        elif not message.data or message.data[0] != wire.STREAM_FROM_SERVO:
            self.refuse("CarriageFeedback", message)
        return True

    def _replied(self, values: Mapping[int, float], stamp: float) -> None:
        """Mode and fault, then feedback and heartbeat."""
        before, self._servo = self._servo, int(values[wire.MODE])
        self._held_s = values.get(wire.WATCHDOG_TIMEOUT, math.nan)
        self._led = self._led or (self._armed and self._servo == wire.POSITION_MODE)
        self._unanswered = 0
        if self._led and self._servo == wire.STOPPED and (self._armed or self._left == "silent"):
            self._armed = False
            self._left = "it was silent, perhaps booted anew" if self._left else "it stopped by itself"
        self._forgiven = max(self._forgiven - 1, 0)
        self._judge(int(values.get(wire.FAULT_CODE, 0.0)), stamp)
        scale = self.table.turns_per_m
        self._place_m = values.get(wire.POSITION, math.nan) / scale
        self._speed_m_s = values.get(wire.VELOCITY, math.nan) / scale
        self.feed(self.shown, self._place_m, self._speed_m_s, stamp)
        if stamp - self._beat_at >= _BEAT_S:
            self._beat_at = stamp
            self.beat(self.shown, stamp, anew=before < 0)

    def _judge(self, code: int, stamp: float) -> None:
        """Latch a fault and tell it."""
        if self._servo not in (wire.FAULTED, wire.TIMED_OUT) or self._latched or self._forgiven:
            return
        timed_out = self._servo == wire.TIMED_OUT
        name, told = _WATCHDOG if timed_out else FAULTS.get(code, (f"fault {code}", _INTERNAL))
        self._latched, self._armed, self._left = name, False, ""
        self.fail(told, code, stamp)

    def _lead(self, timeout: float | None) -> None:
        """Position mode: from the last place in a straight line to the wanted one within the tick."""
        begin = self._wanted_m if self._servo != wire.POSITION_MODE else self._last_m
        self._rate_m_s = rate = (self._wanted_m - begin) / self._tick_s
        self._last_m = self._wanted_m
        self._asked = 0 if self._servo == wire.POSITION_MODE else self._asked + 1
        if self._asked > _GIVE_UP_TICKS:
            self._armed, self._left = False, "it did not enter position mode"
        self._aim(begin, rate, timeout)

    def _rest(self, timeout: float | None) -> None:
        """A step of the way to rest of a drive that operates; at rest it is stopped. Where it does not stop, it is only
        asked on, and its watchdog ends it.
        """
        if self._latched or self._servo <= wire.FAULTED:
            return
        led = not math.isnan(self._last_m)
        onward = (self._last_m, self._rate_m_s) if led else (self._place_m, self._speed_m_s)
        step = self._braking.step(*onward) if self._servo == wire.POSITION_MODE else None
        if step is not None:
            self._aim(*step, timeout)
        elif self._stopped < IDLE_TICKS:
            self._stopped += 1
            self._tell(wire.mode_write(wire.STOPPED), timeout)

    def _aim(self, place_m: float, rate_m_s: float, timeout: float | None) -> None:
        scale, table = self.table.turns_per_m, self.table
        self._tell(wire.command(place_m * scale, rate_m_s * scale, table.most_torque_N_m, table.watchdog_s), timeout)

    def _tell(self, data: bytes, timeout: float | None) -> None:
        self.inner.send(wire.frame_to(self.table.node_id, data), timeout)


def set_up(bus: can.BusABC, table: MoteusTable) -> None:
    """Find the drive, read back what it does without commands, and let it take the watchdog; it stays stopped. Blocks,
    at most some seconds. Its configuration is only read.

    Raises ValueError of one sentence where no drive answers or it is not as it must be.
    """
    ask, node = _Questions(bus, table), f"moteus: node {table.node_id}"
    found = ask.values(wire.QUERY + wire.read(wire.HOME_STATE))
    if found[wire.MODE] not in (wire.STOPPED, wire.FAULTED, wire.TIMED_OUT):
        raise ValueError(f"{node} must be stopped before it is led; got mode {found[wire.MODE]:g}, by somebody else")
    if table.home == "kept" and found.get(wire.HOME_STATE, 0.0) == 0.0:
        raise ValueError(
            f"{node} must know its place (home state rotor or output); got relative only: moteus.home = 'here' makes"
            " the present place zero"
        )
    default, mode = ask.setting("servo.default_timeout_s"), ask.setting("servo.timeout_mode")
    if math.isnan(default):
        raise ValueError(f"{node} must have a watchdog of its own (servo.default_timeout_s); got nan, which is none")
    if mode not in BRAKING_MODES:
        raise ValueError(
            f"{node} must brake once its watchdog expires: servo.timeout_mode must be one of"
            f" {', '.join(map(str, BRAKING_MODES))}; got {mode:g}"
        )
    if found[wire.MODE] != wire.STOPPED:
        return
    if table.home == "here":
        ask.values(wire.write(wire.SET_OUTPUT_EXACT, (0.0,)) + wire.QUERY)
    taken = ask.values(
        wire.mode_write(wire.STOPPED) + wire.write(wire.WATCHDOG_TIMEOUT, (table.watchdog_s,)) + wire.QUERY
    )
    held = taken.get(wire.WATCHDOG_TIMEOUT, math.nan)
    if not math.isclose(held, table.watchdog_s, rel_tol=1e-6):
        raise ValueError(f"{node} must hold the watchdog of {table.watchdog_s:g} s (register 0x027); it holds {held:g}")


class _Questions:
    """Questions to the drive and its answers, before the controller listens."""

    def __init__(self, bus: can.BusABC, table: MoteusTable) -> None:
        self._bus, self._table = bus, table
        self._errors, self._others = 0, set[int]()

    def values(self, data: bytes) -> dict[int, float]:
        """The registers that the drive tells, asked for again each 0.1 s."""
        end = time.monotonic() + self._table.answers_s
        while time.monotonic() < end:
            found = wire.told(self._reply(data, 0.1))
            if wire.MODE in found:
                return found
        raise self._silent()

    def setting(self, name: str) -> float:
        """A value of its configuration, over its diagnostic stream."""
        while self._poll():
            pass
        line = f"conf get {name}\n".encode()
        self._reply(bytes((wire.STREAM_TO_SERVO, 1, len(line))) + line, 0.05)
        text, end = b"", time.monotonic() + self._table.answers_s
        while not text.endswith(b"\n"):
            if time.monotonic() > end:
                raise ValueError(f"moteus: node {self._table.node_id} must tell {name} over its diagnostic stream")
            text += self._poll()
        try:
            return float(text.decode("ascii", "replace").split()[-1])
        except (ValueError, IndexError):
            words = " ".join(text.decode("ascii", "replace").split())
            raise ValueError(
                f"moteus: node {self._table.node_id} must tell {name} as a number; got {words!r}"
            ) from None

    def _poll(self) -> bytes:
        """What the stream has, at most 48 bytes."""
        data = self._reply(bytes((wire.STREAM_POLL, 1, 48)), 0.05)
        return data[3 : 3 + data[2]] if len(data) >= 3 and data[:2] == bytes((wire.STREAM_FROM_SERVO, 1)) else b""

    def _silent(self) -> ValueError:
        """That nobody answers, and who does instead."""
        self._reply(wire.QUERY, 0.2, wire.BROADCAST)
        causes = "both bit rates, sample points, termination", "supply, wiring, bit rates 1 and 5 Mbit/s"
        node = f"moteus: node {self._table.node_id}"
        return silent(node, self._table.answers_s, self._others, self._errors, causes)

    def _reply(self, data: bytes, seconds: float, node: int = 0) -> bytes:
        """The next reply within `seconds`, empty where there is none; what came before is let go."""
        try:
            while self._bus.recv(0) is not None:
                pass
            self._bus.send(wire.frame_to(node or self._table.node_id, data), timeout=0.1)
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            raise ValueError(f"moteus: node {self._table.node_id} must be reached; got: {error}") from None
        for message in heard_for(self._bus, seconds):
            self._errors += message.is_error_frame
            speaker = wire.replier(message)
            if speaker == self._table.node_id:
                return bytes(message.data)
            if speaker > 0:
                self._others.add(speaker)
        return b""
