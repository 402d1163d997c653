"""Finds an ODrive, sees what it is doing and that it stops by itself, and gives it mode and limits, before anything
moves.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import can

from controller.limits import Limits
from hil.nodes.carriage_bus import RESTS_M_S
from hil.nodes.frame_map import plain
from hil.nodes.listening import heard_for, silent
from hil.nodes.odrive import protocol as wire
from hil.nodes.odrive.table import FREE_NODES, READ_BACK, OdriveTable

LISTEN_S: Final = 0.3  # for which a drive is listened to first
_ZERO_M: Final = 1e-3
"""How far off zero a drive may tell its place that has just been made zero."""


def set_up(bus: can.BusABC, table: OdriveTable, limits: Limits, tick_s: float, *, faulty: bool = False) -> list[str]:
    """Find the drive, read its watchdog back, see that it rests, knows its place and reports often enough, and give it
    mode and limits, which are read back where their endpoints are stated; it stays idle. Blocks, at most some seconds.
    Nothing is written to its stored configuration. Gives a sentence for what is not read back. `faulty`: one with an
    error is set up, too, for it is to be acknowledged.

    Raises ValueError of one sentence where no drive answers, it may not be left alone, or it is not as it must be.
    """
    table.check_speed(limits.carriage_speed_m_s)
    ask = _Questions(bus, table)
    version = ask.reply(wire.GET_VERSION, b"", wire.GET_VERSION, lambda data: len(data) == 8)
    firmware = ".".join(map(str, version[4:7]))
    node = f"odrive: node {table.node_id}"
    if firmware != table.firmware:
        raise ValueError(
            f"{node} must have the firmware {table.firmware} of odrive.firmware, whose endpoint ids are stated; got"
            f" {firmware}"
        )
    _check_watchdog(ask, table, node)
    heard = ask.cycles(LISTEN_S)
    _check_cycles(heard, node, tick_s)
    _check_axis(heard, node, faulty=faulty)
    if not faulty:
        _check_place(heard, table, limits, node)
    fastest = abs(table.turns_per_m) * limits.carriage_speed_m_s
    ask.tell(wire.SET_CONTROLLER_MODE, struct.pack("<II", wire.POSITION_CONTROL, wire.PASSTHROUGH))
    ask.tell(wire.SET_LIMITS, struct.pack("<ff", fastest, table.motor_current_A))
    if table.home == "here" and not faulty:
        _take_zero(ask, table, node)
    last = f"{node}'s last procedure ended with {wire.result_of(heard.result)}"
    told = [] if heard.result == wire.SUCCESS else [last]
    return told + _read_back(ask, table, limits.carriage_speed_m_s, node)


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


def _check_cycles(heard: _Heard, node: str, tick_s: float) -> None:
    """It must tell its state and its place often enough."""
    if heard.beats < 0.8 * LISTEN_S / wire.HEARTBEAT_S:
        raise ValueError(
            f"{node} must send a heartbeat every {1e3 * wire.HEARTBEAT_S:g} ms (can.heartbeat_msg_rate_ms); got"
            f" {heard.beats} in {LISTEN_S:g} s"
        )
    if len(heard.turns) < 0.8 * LISTEN_S / (2 * tick_s):
        raise ValueError(
            f"{node} must send its encoder estimates every {2e3 * tick_s:g} ms (can.encoder_msg_rate_ms); got"
            f" {len(heard.turns)} in {LISTEN_S:g} s"
        )


def _check_axis(heard: _Heard, node: str, *, faulty: bool) -> None:
    """It must do nothing, and have no error but where `faulty`."""
    if heard.axis != wire.IDLE:
        doing = wire.AXIS_STATES.get(heard.axis, f"axis state {heard.axis}")
        raise ValueError(f"{node} must be idle before it is led; got {doing}")
    if heard.result == wire.BUSY:
        raise ValueError(f"{node} must be idle before it is led; got a procedure that goes on (Procedure_Result BUSY)")
    if heard.errors and not faulty:
        words = wire.words_of(heard.errors) or "INITIALIZING"
        raise ValueError(
            f"{node} must have no active error before it is led; got {words}; once its cause is gone, 'capsule run"
            " RIG.toml reset' acknowledges it"
        )


def _check_place(heard: _Heard, table: OdriveTable, limits: Limits, node: str) -> None:
    """It must know its place, within the travel, and rest there."""
    scale = table.turns_per_m
    places, speeds = [turns / scale for turns, _ in heard.turns], [speed / scale for _, speed in heard.turns]
    if not all(map(math.isfinite, places + speeds)):
        raise ValueError(f"{node} must know its place and speed before it is led; its encoder estimates are nan")
    speed = max(sum(map(abs, speeds)) / len(speeds), (max(places) - min(places)) / LISTEN_S)
    if speed > RESTS_M_S:
        raise ValueError(
            f"{node} must rest before it is led; its encoder tells {speed:.3g} m/s ({speed * abs(scale):.3g} turns/s)"
        )
    if table.home == "kept" and abs(places[-1]) > limits.travel_m:
        raise ValueError(
            f"{node} must stand within limits.travel_m, {limits.travel_m:g} m of its zero; got {places[-1]:g} m: home"
            ' it, or state odrive.home = "here"'
        )


def _take_zero(ask: _Questions, table: OdriveTable, node: str) -> None:
    """Make the present place zero, and see that the encoder tells so."""
    ask.tell(wire.SET_ABSOLUTE_POSITION, wire.ABSOLUTE_POSITION.pack(0.0))
    end, place = time.monotonic() + min(table.answers_s, 1.0), math.inf
    while time.monotonic() < end and not abs(place) <= _ZERO_M:
        told = ask.cycles(0.02).turns
        place = told[-1][0] / table.turns_per_m if told else place
    if not abs(place) <= _ZERO_M:
        raise ValueError(f"{node} must take its place as zero (Set_Absolute_Position); its encoder tells {place:g} m")


def _read_back(ask: _Questions, table: OdriveTable, speed_m_s: float, node: str) -> list[str]:
    """See that it holds what it was told, where it can be asked; and what it was not asked for."""
    for path, number in table.endpoints:
        kind, wanted = READ_BACK[path]
        held, value = ask.endpoint(number, kind), wanted(table, speed_m_s)
        if not math.isclose(held, value, rel_tol=1e-6):
            raise ValueError(f"{node} must hold {value:g} at {path}; it holds {held:g}")
    missing = [path for path in READ_BACK if path not in dict(table.endpoints)]
    if not missing:
        return []
    return [f"{node} is not asked for {', '.join(missing)}: [odrive.endpoints] does not state their ids"]


@dataclass
class _Heard:
    """What a drive tells in its cycles: how often it beats, its axis state, errors and result told last, places and
    speeds in turns.
    """

    beats: int = 0
    axis: int = wire.UNDEFINED
    errors: int = 0
    result: int = wire.SUCCESS
    turns: list[tuple[float, float]] = field(default_factory=list)


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

        data = self.reply(wire.RX_SDO, struct.pack("<BHB", 0, number, 0), wire.TX_SDO, fits)
        return float(struct.unpack_from(kind, data, 4)[0])

    def cycles(self, seconds: float) -> _Heard:
        """What it tells within `seconds`."""
        found = _Heard()
        for command, data in self._hear(seconds):
            if command == wire.HEARTBEAT and len(data) >= 7:
                found.beats += 1
                found.errors, found.axis, found.result = struct.unpack_from("<IBB", data)
            elif command == wire.GET_ENCODER_ESTIMATES and len(data) >= 8:
                found.turns.append(struct.unpack_from("<ff", data))
        return found

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
            elif command == wire.HEARTBEAT and node in FREE_NODES and len(message.data) == 8:
                self._others.add(node)
        return found
