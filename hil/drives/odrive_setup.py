"""Sets an ODrive up over CANSimple, before anything moves."""

import math
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import can

from controller.limits import Limits
from hil.bus.wrapping import plain
from hil.drives import odrive_protocol as wire
from hil.drives.odrive_protocol import FREE_NODES, READ_BACK, Command, OdriveTable
from hil.drives.table import Questions

LISTEN_S: Final = 0.3  # of listening to the drive at first
_ZERO_M: Final = 1e-3  # tolerance of a position that has just been set to zero


def set_up(bus: can.BusABC, table: OdriveTable, limits: Limits, tick_s: float, *, faulty: bool = False) -> list[str]:
    """See `hil.drives.makers.Maker`; its stored configuration is not changed."""
    table.check_speed(limits.carriage_speed_m_s)
    ask = _Questions(bus, table)
    _stops(table, ask)
    heard = ask.cycles(LISTEN_S)
    for what, cycle_s, key, count in (
        ("a heartbeat", wire.HEARTBEAT_S, "heartbeat", heard.beats),
        ("its encoder estimates", 2 * tick_s, "encoder", len(heard.turns)),
    ):
        words = f"send {what} every {1e3 * cycle_s:g} ms (can.{key}_msg_rate_ms); got {count} in {LISTEN_S:g} s"
        table.must(count >= 0.8 * LISTEN_S / cycle_s, words)
    _idles(table, heard, faulty)
    if not faulty:
        _rests_where_known(heard, table, limits)
    ask.tell(wire.SET_CONTROLLER_MODE, wire.POSITION_CONTROL, wire.PASSTHROUGH)
    ask.tell(wire.SET_LIMITS, abs(table.turns_per_m) * limits.carriage_speed_m_s, table.motor_current_A)
    if table.home == "here" and not faulty:
        _is_zero(table, ask)
    for path, number in table.endpoints:
        kind, required = READ_BACK[path]
        got, value = ask.endpoint(number, kind), required(table, limits.carriage_speed_m_s)
        table.must(math.isclose(got, value, rel_tol=1e-6), f"hold {value:g} at {path}; it holds {got:g}")
    last = [f"{table.node}'s last procedure ended with {wire.result_of(heard.result)}"]
    missing = [path for path in READ_BACK if path not in dict(table.endpoints)]
    unread = [f"{table.node} is not asked for {', '.join(missing)}: [odrive.endpoints] does not state their ids"]
    return (last if heard.result != wire.SUCCESS else []) + (unread if missing else [])


def _stops(table: OdriveTable, ask: "_Questions") -> None:
    firmware = ask.firmware()
    words = f"have the firmware {table.firmware} of odrive.firmware, whose endpoint ids are stated; got {firmware}"
    table.must(firmware == table.firmware, words)
    table.must(
        table.enable_watchdog_endpoint and table.watchdog_timeout_endpoint,
        "be read back before anything moves: odrive.enable_watchdog_endpoint and odrive.watchdog_timeout_endpoint must"
        " be the ids of axis0.config.enable_watchdog and watchdog_timeout in its firmware's flat_endpoints.json; a"
        " firmware before 0.6 cannot be asked over CAN",
        "'s watchdog",
    )
    on = ask.endpoint(table.enable_watchdog_endpoint, "<?")
    timeout = ask.endpoint(table.watchdog_timeout_endpoint, "<f")
    table.must(on, "be on (axis0.config.enable_watchdog = True); it is off", "'s watchdog")
    within = f"expire within {table.watchdog_s:g} s (axis0.config.watchdog_timeout); got {timeout:g}"
    table.must(0 < timeout <= table.watchdog_s * (1 + 1e-6), within, "'s watchdog")


def _idles(table: OdriveTable, heard: "_Heard", faulty: bool) -> None:
    doing = wire.AXIS_STATES.get(heard.axis, f"axis state {heard.axis}")
    table.must(heard.axis == wire.IDLE, f"be idle before the run; got {doing}")
    busy = heard.result == wire.BUSY
    table.must(not busy, "be idle before the run; got a procedure that goes on (Procedure_Result BUSY)")
    table.must(
        not heard.errors or faulty,
        f"have no active error before the run; got {wire.words_of(heard.errors) or 'INITIALIZING'}; once its cause is"
        " gone, 'capsule run RIG.toml reset' acknowledges it",
    )


def _rests_where_known(heard: "_Heard", table: OdriveTable, limits: Limits) -> None:
    scale = table.turns_per_m
    places, speeds = [turns / scale for turns, _ in heard.turns], [speed / scale for _, speed in heard.turns]
    nan = "know its position and speed before the run; its encoder estimates are nan"
    table.must(all(map(math.isfinite, places + speeds)), nan)
    speed = max(sum(map(abs, speeds)) / len(speeds), (max(places) - min(places)) / LISTEN_S)
    table.must_rest(speed, f"its encoder shows {speed:.3g} m/s ({speed * abs(scale):.3g} turns/s)")
    if table.home == "kept":
        table.must_stand_within(limits.travel_m, places[-1], 'home it, or state odrive.home = "here"')


def _is_zero(table: OdriveTable, ask: "_Questions") -> None:
    ask.tell(wire.SET_ABSOLUTE_POSITION, 0.0)
    end, position = time.monotonic() + min(table.answers_s, 1.0), math.inf
    while time.monotonic() < end and not abs(position) <= _ZERO_M:
        turns = ask.cycles(0.02).turns
        position = turns[-1][0] / table.turns_per_m if turns else position
    words = f"take its position as zero (Set_Absolute_Position); its encoder shows {position:g} m"
    table.must(abs(position) <= _ZERO_M, words)


@dataclass
class _Heard:
    """The cyclic frames of a drive: count of heartbeats, the last one, positions and speeds in turns."""

    beats: int = 0
    axis: int = wire.UNDEFINED
    errors: int = 0
    result: int = wire.SUCCESS
    turns: list[tuple[float, float]] = field(default_factory=list)


class _Questions(Questions):
    def __init__(self, bus: can.BusABC, table: OdriveTable) -> None:
        super().__init__(bus, table, self._from)
        self._id = table.node_id

    def _from(self, message: can.Message) -> int:
        """The node of the drive's frames, and of another node's heartbeat."""
        node, command = message.arbitration_id >> 5, message.arbitration_id & 0x1F
        beats = command == wire.HEARTBEAT.number and node in FREE_NODES and len(message.data) == wire.HEARTBEAT.length
        return node if plain(message) and (node == self._id or beats) else -1

    def tell(self, command: Command, *values: float) -> None:
        self.send(command.to(self._id, *values))

    def firmware(self) -> str:
        data = self._answer(wire.GET_VERSION.to(self._id), wire.GET_VERSION, lambda data: len(data) == 8)
        return ".".join(map(str, data[4:7]))

    def endpoint(self, number: int, kind: str) -> float:
        def fits(data: bytes) -> bool:
            values = wire.TX_SDO.read(data)
            return values is not None and values[1] == number and len(data) >= 4 + struct.calcsize(kind)

        data = self._answer(wire.RX_SDO.to(self._id, 0, number, 0), wire.TX_SDO, fits)
        return float(struct.unpack_from(kind, data, 4)[0])

    def _answer(self, question: can.Message, answer: Command, fits: Callable[[bytes], bool]) -> bytes:
        number = answer.number
        found = self.answer(lambda: question, lambda one: one.arbitration_id & 0x1F == number and fits(bytes(one.data)))
        if found is None:
            raise self.silent("bit rate, wiring, termination", "supply, wiring, bit rate")
        return bytes(found.data)

    def cycles(self, seconds: float) -> _Heard:
        found = _Heard()
        for message in self.heard(seconds):
            command, data = message.arbitration_id & 0x1F, bytes(message.data)
            if command == wire.HEARTBEAT.number and (beat := wire.HEARTBEAT.read(data)):
                found.beats += 1
                found.errors, found.axis, found.result, _ = beat
            elif command == wire.GET_ENCODER_ESTIMATES.number and (turns := wire.GET_ENCODER_ESTIMATES.read(data)):
                found.turns.append((turns[0], turns[1]))
        return found
