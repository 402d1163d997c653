"""Sets a CiA 402 drive up over SDO before anything moves. Needs the package canopen."""

import logging
import math
import time
from dataclasses import dataclass
from typing import Any, Final

import can

from controller.limits import Limits
from hil.drives import cia402_protocol as p402
from hil.drives.cia402_protocol import Cia402Table
from hil.nodes.frame_map import CARRIAGE_MAP, QUICK_STOP_M_S2

_HERE_M: Final = 1e-4  # tolerated distance from its home offset after homing in place
_WORDS: Final = {
    p402.DISABLED: p402.SHUTDOWN,
    p402.READY_TO_SWITCH_ON: p402.SWITCH_ON,
    p402.SWITCHED_ON: p402.ENABLE_OPERATION,
    p402.OPERATION: p402.ENABLE_OPERATION | p402.START_HOMING,
}
_MODE_S, _ERROR_S = 0.5, 0.1
"""Time within which a drive must show a mode; time after the start from which a homing error is a new one."""


def word_of(node: Any, index: int, *, signed: bool = False) -> int:
    return int.from_bytes(node.sdo.upload(index, 0), "little", signed=signed)


def take_mode(node: Any, table: Cia402Table, mode: int) -> None:
    """Ask for a mode (0x6060) and wait until it is shown (0x6061). Raises ValueError."""
    node.sdo.download(0x6060, 0, mode.to_bytes(1, "little"))
    end = time.monotonic() + _MODE_S
    while (shown := word_of(node, 0x6061, signed=True)) != mode:
        if time.monotonic() > end:
            raise ValueError(_another_mode(table, mode, shown))
        time.sleep(0.005)


def _another_mode(table: Cia402Table, mode: int, shown: int) -> str:
    return f"{table.node} must take mode {p402.mode_words(mode)}; 0x6061 shows {p402.mode_words(shown)}"


def home(node: Any, network: Any, table: Cia402Table) -> None:
    """Let the drive home itself under our heartbeat, and disable it again in any case. Raises ValueError."""
    take_mode(node, table, p402.HOMING_MODE)
    end, run = time.monotonic() + table.homing_s, _Homing(table)
    try:
        while True:
            network.send_message(0x700 + p402.MASTER_NODE, bytes((p402.OPERATIONAL,)))
            status = word_of(node, 0x6041)
            if run.done(node, status):
                break
            if time.monotonic() > end:
                old = "; bit 12 is from before it was started" if status & p402.ATTAINED and not run.away else ""
                table.must(False, f"be home within {table.homing_s:g} s; statusword 0x{status:04X}{old}")
            word = _WORDS.get(p402.state_of(status), p402.DISABLE_VOLTAGE)
            node.sdo.download(0x6040, 0, word.to_bytes(2, "little"))
            if word & p402.START_HOMING:
                run.started_s = min(run.started_s, time.monotonic())
            time.sleep(0.005)
    finally:
        for word in (p402.HALT_QUICKLY, p402.DISABLE_VOLTAGE):
            node.sdo.download(0x6040, 0, word.to_bytes(2, "little"))
            time.sleep(0.05)


class _Homing:
    """Follows the statusword during homing. Bit 12 may still be set by an earlier homing: it counts once it has been
    cleared since the start (`away`), or if the drive homes in place and stands at its home offset.
    """

    def __init__(self, table: Cia402Table) -> None:
        self._table, self.away = table, False
        self.started_s = math.inf

    def done(self, node: Any, status: int) -> bool:
        """Whether it is home: in mode 6, in operation, home attained since the start, at rest. Raises ValueError."""
        name, state = self._table.node, p402.state_of(status)
        if state in (p402.REACTING, p402.FAULTED):
            raise ValueError(f"{name} must home; got a fault, error code 0x{word_of(node, 0x603F):04X}")
        if state == p402.OPERATION and (mode := word_of(node, 0x6061, signed=True)) != p402.HOMING_MODE:
            raise ValueError(_another_mode(self._table, p402.HOMING_MODE, mode))
        if state != p402.OPERATION:
            return False
        self.away = self.away or not status & p402.ATTAINED
        since_s = time.monotonic() - self.started_s
        if status & p402.HOMING_ERROR and since_s > _ERROR_S:
            raise ValueError(f"{name} must home; got a homing error (bit 13 of statusword 0x{status:04X})")
        attained = status & p402.ATTAINED and status & p402.REACHED
        return since_s > 0 and bool(attained) and (self.away or self._here(node))

    def _here(self, node: Any) -> bool:
        if self._table.homing_method not in p402.HOMES_HERE:
            return False
        try:
            offset = word_of(node, 0x607C, signed=True)
        except Exception:  # noqa: BLE001 - an optional object; drivers raise whatever they like
            offset = 0
        return abs(word_of(node, 0x6064, signed=True) - offset) <= max(_HERE_M * self._table.counts_per_m, 1.0)


HEARTBEAT_MS: Final = 20  # of drive and master
HEARTBEAT_LOST_MS: Final = 60  # three of them
PROFILE: Final = 0x192  # device type's lower half
_INVALID: Final = 1 << 31  # bit of a PDO that is off, CiA 301
_SYNCHRONOUS: Final = 1  # transmission type, CiA 301
# objects of each mapping: index, sub, bits
_MAPPED: Final = {0x1600: (0x60400010, 0x607A0020), 0x1A00: (0x60410010, 0x60640020), 0x1A01: (0x606C0020, 0x603F0010)}
_BY_VELOCITY: Final = (0x60400010, 0x60FF0020)  # RPDO 1 of a drive that follows speeds
_LOOK_S: Final = 0.1  # in which a drive must be seen to rest
ROUNDED: Final = (0x1017, 0x6065, 0x6066, 0x607D, 0x607F, 0x6085, 0x6099)
"""Objects, beside the table's options, that a drive may round by one count or 0.1 %."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One object of the dictionary: `index`, `sub`, its `size` in bytes, and its `value`."""

    index: int
    sub: int
    size: int
    value: int

    @property
    def data(self) -> bytes:
        return self.value.to_bytes(self.size, "little", signed=self.value < 0)


def entries(table: Cia402Table, limits: Limits, tick_s: float, time_to_live_ms: int) -> tuple[Entry, ...]:
    """All settings of the drive, in order. RPDO 1 acts at SYNC and has a deadline of `time_to_live_ms`. Its expiry is a
    fault (0x6007: 1) that brakes (0x605E: 2), and so is the loss of the controller's heartbeat. A quick stop brakes and
    ends disabled (0x605A: 2).
    """
    node, counts = table.node_id, table.counts_per_m
    travel, speed = round(limits.travel_m * counts), round(limits.carriage_speed_m_s * counts)
    slow = max(round(table.homing_speed_m_s * counts), 1)
    window = Entry(0x6065, 0, 4, round(table.following_m * counts))
    following = (window, Entry(0x6066, 0, 2, round(1e3 * table.following_s)))
    homing = (Entry(0x6098, 0, 1, table.homing_method), Entry(0x6099, 1, 4, slow), Entry(0x6099, 2, 4, slow))
    return (
        Entry(0x1005, 0, 4, p402.SYNC_ID),
        Entry(0x1016, 1, 4, p402.MASTER_NODE << 16 | HEARTBEAT_LOST_MS),
        Entry(0x1017, 0, 2, HEARTBEAT_MS),
        *_mapping(0x1400, 0x1600, 0x200 + node, Entry(0x1400, 5, 2, time_to_live_ms), by=table.mode),
        *_mapping(0x1800, 0x1A00, 0x180 + node),
        *_mapping(0x1801, 0x1A01, 0x280 + node),
        Entry(0x6007, 0, 2, 1),
        Entry(0x605A, 0, 2, 2),
        Entry(0x605E, 0, 2, 2),
        *(following if table.following_m else ()),
        Entry(0x607D, 1, 4, -travel),
        Entry(0x607D, 2, 4, travel),
        Entry(0x607F, 0, 4, speed),
        Entry(0x6085, 0, 4, round(QUICK_STOP_M_S2 * counts)),
        Entry(0x60C2, 1, 1, round(1e4 * tick_s)),
        Entry(0x60C2, 2, 1, -4),
        *(homing if table.homing_method else ()),
        Entry(0x6060, 0, 1, p402.MODES[table.mode]),
    )


def _mapping(parameters: int, mapping: int, identifier: int, *more: Entry, by: str = "position") -> tuple[Entry, ...]:
    """A process data object: off, its contents, on."""
    objects = _BY_VELOCITY if mapping == 0x1600 and by == "velocity" else _MAPPED[mapping]
    return (
        Entry(parameters, 1, 4, _INVALID | identifier),
        Entry(parameters, 2, 1, _SYNCHRONOUS),
        *more,
        Entry(mapping, 0, 1, 0),
        *(Entry(mapping, k, 4, value) for k, value in enumerate(objects, 1)),
        Entry(mapping, 0, 1, len(objects)),
        Entry(parameters, 1, 4, identifier),
    )


def set_up(bus: can.BusABC, table: Cia402Table, limits: Limits, tick_s: float, *, faulty: bool = False) -> list[str]:
    """See `hil.drives.makers.Maker`: objects, homing if the table asks for it, PDOs. Needs the package canopen."""
    try:
        import canopen
    except ImportError:
        hint = "pip install 'capsule-control[canopen]'"
        raise ValueError(f"cia402 must have the package canopen; install the extra: {hint}") from None
    logging.getLogger("canopen").setLevel(logging.CRITICAL)
    network = canopen.Network(bus)
    network.connect()
    life_ms = CARRIAGE_MAP.life_ms(limits.carriage_speed_m_s)
    try:
        node = network.add_node(canopen.RemoteNode(table.node_id, canopen.ObjectDictionary()))
        node.sdo.RESPONSE_TIMEOUT = table.answers_s
        _is_idle(node, table, faulty)
        node.nmt.state = "PRE-OPERATIONAL"
        rounded = [_set(node, table, entry) for entry in entries(table, limits, tick_s, life_ms)]
        for index, sub, value in table.options:
            size = len(node.sdo.upload(index, sub))
            rounded.append(_set(node, table, Entry(index, sub, size, value), may_round=True))
        if table.homing_method and not faulty:
            home(node, network, table)
        take_mode(node, table, p402.MODES[table.mode])
        if not faulty:
            _rests_where_known(node, table, limits)
        node.nmt.state = "OPERATIONAL"
        return [sentence for sentence in rounded if sentence]
    except ValueError:
        raise
    except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
        raise ValueError(f"{table.node} must answer and take its settings; got: {error}") from None
    finally:
        if network.notifier is not None:
            network.notifier.stop(2 * network.NOTIFIER_CYCLE)


def _is_idle(node: Any, table: Cia402Table, faulty: bool) -> None:
    """Check that the drive knows its modes, has no fault (unless `faulty`), and is disabled."""
    try:
        kind = word_of(node, 0x1000) & 0xFFFF
    except Exception:  # noqa: BLE001 - drivers of many makers raise whatever they like
        node.nmt.state = "PRE-OPERATIONAL"
        kind = word_of(node, 0x1000) & 0xFFFF
    table.must(kind == PROFILE, f"be a drive of profile 402; got profile {kind}")
    known = word_of(node, 0x6502)
    knows = ", ".join(p402.mode_words(bit + 1) for bit in range(16) if known >> bit & 1) or "none"
    for mode in (p402.MODES[table.mode], *([p402.HOMING_MODE] if table.homing_method else ())):
        table.must(known >> (mode - 1) & 1, f"know mode {p402.mode_words(mode)}; 0x6502 says that it knows {knows}")
    end = time.monotonic() + table.answers_s
    while (state := p402.state_of(word := word_of(node, 0x6041))) == p402.NOT_READY and time.monotonic() < end:
        time.sleep(0.01)
    if state in (p402.FAULTED, p402.REACTING):
        got = f"got error code 0x{word_of(node, 0x603F):04X}; 'capsule run RIG.toml reset' acknowledges it"
        table.must(faulty, f"have no fault before the run; {got}")
    got = "no state that is ready" if state == p402.NOT_READY else "operation, enabled by another master"
    disabled = state not in (p402.OPERATION, p402.QUICK_STOPPING, p402.NOT_READY)
    table.must(disabled, f"be disabled before the run; got {got} (statusword 0x{word:04X})")


def _rests_where_known(node: Any, table: Cia402Table, limits: Limits) -> None:
    places = list[float]()
    for wait_s in (_LOOK_S, 0.0):
        places.append(word_of(node, 0x6064, signed=True) / table.counts_per_m)
        speed = word_of(node, 0x606C, signed=True) / table.counts_per_m
        time.sleep(wait_s)
    speed = max(abs(speed), abs(places[1] - places[0]) / _LOOK_S)
    table.must_rest(speed, f"its speed is {speed:.3g} m/s")
    table.must_stand_within(limits.travel_m, places[1], "home it (cia402.homing_method)")


def _set(node: Any, table: Cia402Table, entry: Entry, *, may_round: bool = False) -> str:
    """Write an object and read it back; a sentence if it was rounded as it may be, else "". Raises ValueError."""
    where = f"0x{entry.index:04X}:{entry.sub:02X}"
    try:
        node.sdo.download(entry.index, entry.sub, entry.data)
    except OverflowError:
        raise ValueError(f"cia402.options: {where} must fit into {entry.size} bytes; got {entry.value}") from None
    data = node.sdo.upload(entry.index, entry.sub)
    if data == entry.data:
        return ""
    got = int.from_bytes(data, "little", signed=entry.value < 0)
    near = abs(got - entry.value) <= max(1, abs(entry.value) // 1000) and len(data) == entry.size
    if near and (may_round or entry.index in ROUNDED):
        return f"{table.node} holds {got} at {where}, rounded from {entry.value}"
    raise ValueError(f"{table.node} must take {entry.value} at {where}; it holds {data.hex()}")
