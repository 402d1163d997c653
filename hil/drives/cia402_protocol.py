"""CiA 402 for the carriage: table, states, controlwords, process data. Standard: IEC 61800-7-201."""

import struct
from collections.abc import Mapping
from typing import Annotated, Final

import can
from pydantic import BeforeValidator

from hil.bus.wrapping import plain
from hil.drives.table import CODES, NODE, ActuatorTable, faults_of
from hil.nodes import frame_map as our
from models.rigs.schema import Among, key

DISABLED, READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION, QUICK_STOPPING, REACTING, FAULTED = range(1, 8)
"""States of the power drive system; 0 is "not ready to switch on"."""
NOT_READY: Final = 0  # state of any other statusword
_MASKS: Final = (0x4F, 0x4F, 0x6F, 0x6F, 0x6F, 0x6F, 0x4F, 0x4F)  # of the statusword, CiA 402 state by state
_WORDS: Final = (0x00, 0x40, 0x21, 0x23, 0x27, 0x07, 0x0F, 0x08)
"""Masks and values of the statusword's bits for each state."""
WARNING: Final = 0x80  # bit of the statusword: the drive does not do all that is requested
VOLTAGE, REMOTE, LIMITED = 1 << 4, 1 << 9, 1 << 11
"""Further bits: voltage enabled, controlwords of the bus are obeyed, a limit of the drive's own is active."""
FOLLOWS, DEVIATES = 1 << 12, 1 << 13
"""In a cyclic mode: the target is followed; the position error is beyond 0x6065 for longer than 0x6066."""
REACHED, ATTAINED, HOMING_ERROR = 1 << 10, 1 << 12, 1 << 13
"""While homing: at rest at the target, home attained, homing failed."""
DISABLE_VOLTAGE, SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, HALT_QUICKLY, RESET_FAULT = 0x00, 0x06, 0x07, 0x0F, 0x02, 0x80
"""Controlwords."""
START_HOMING: Final = 1 << 4  # bit of the controlword
HOMES_HERE: Final = (35, 37)  # homing methods that take the present position
SYNC_ID: Final = 0x6A0  # of CANopen's SYNC: its usual identifier 0x80 is that of the catalogue's Sync
MASTER_NODE: Final = 127  # the last node id
_SDO_WRITES: Final = (0, 1, 6)  # client commands of an SDO download: a segment, its begin, a block
OPERATIONAL: Final = 5  # of a heartbeat, CiA 301
HOMING_MODE, CYCLIC_SYNCHRONOUS_POSITION, CYCLIC_SYNCHRONOUS_VELOCITY = 6, 8, 9  # modes of operation
MODE_NAMES: Final = {int(mode): words for mode, words in CODES["cia402"]["modes"].items()}
"""Modes of operation in words, as 0x6061 shows them; bit `mode - 1` of 0x6502 is set if a drive knows it."""
MODES: Final[Mapping[str, int]] = {"position": CYCLIC_SYNCHRONOUS_POSITION, "velocity": CYCLIC_SYNCHRONOUS_VELOCITY}
RPDO: Final = struct.Struct("<Hi")  # controlword 0x6040, target position 0x607A or target velocity 0x60FF
TPDO_STATE: Final = struct.Struct("<Hi")  # statusword 0x6041, actual position 0x6064
TPDO_MORE: Final = struct.Struct("<iH")  # actual velocity 0x606C, error code 0x603F
DEADLINE_ERROR, HEARTBEAT_ERROR, TEMPERATURE_ERROR, SENSOR_ERROR = 0x8250, 0x8130, 0x4310, 0x7300  # CiA 301 and 402
_ERRORS: Final = {number: code for number, (_, code) in faults_of(CODES["cia402"]["errors"]).items()}
_SHOWN: Final = (our.BOOT, our.STANDBY, our.WAITING, our.WAITING, our.ENABLED, our.STOPPING, our.FAULT, our.FAULT)
"""The states in the catalogue's numbers."""


def _options(raw: object) -> object:
    """`[cia402.options]`: index, sub and value of each `"index.sub" = value`, the first two hexadecimal."""
    if not isinstance(raw, Mapping):
        return raw
    found = []
    for name, value in raw.items():
        index, _, sub = str(name).partition(".")
        try:
            address = int(index, 16), int(sub, 16)
        except ValueError:
            address = (-1, -1)
        if not (0x1000 <= address[0] <= 0xFFFF and 0 <= address[1] <= 0xFF):
            raise ValueError(f'must have keys as "6083.0", index and sub hexadecimal; got {name!r}')
        if isinstance(value, bool) or not isinstance(value, int) or not -(1 << 31) <= value < 1 << 32:
            raise ValueError(f"{name} must be an integer of at most 32 bits; got {value!r}")
        found.append((*address, value))
    return tuple(found)


class Cia402Table(ActuatorTable):
    """`[cia402]`: a CANopen drive in a cyclic synchronous mode; `options`: index, sub, value."""

    where = "cia402"
    node_id: int = key(NODE, 1, 1, 15)
    counts_per_m: float = key("its position counts, per metre", 1e6, 1e3, 1e9)
    mode: Annotated[str, Among(MODES)] = key("cyclic synchronous target: `position` or `velocity`", "position")
    velocity_gain_Hz: float = key("for `velocity`: correction per second of the position error", 20.0, 0.1, 200.0)
    homing_method: int = key("object 0x6098: homing by the drive's own motion; 0: none", 0, -128, 127)
    homing_speed_m_s: float = key("object 0x6099: homing speed", 0.01, 1e-4, 0.1)
    homing_s: float = key("longest time of homing", 30.0, 0.1, 600.0)
    following_m: float = key(
        "object 0x6065, for `position`: the following error that stops the drive; 0: not written", 0.005, 0.0, 1.0
    )
    following_s: float = key("object 0x6066: how long that error may last", 0.02, 0.001, 1.0)
    options: Annotated[tuple[tuple[int, int, int], ...], BeforeValidator(_options)] = key(
        'further objects, `"index.sub" = value`, index and sub hexadecimal, each written and read back', ()
    )

    def identifiers(self) -> tuple[frozenset[int], frozenset[int]]:
        """RPDO 1, SYNC and the controller's heartbeat; its TPDOs and heartbeat."""
        says = frozenset(function + self.node_id for function in (0x180, 0x280, 0x700))
        return frozenset({0x200 + self.node_id, SYNC_ID, 0x700 + MASTER_NODE}), says

    def orders(self, message: can.Message) -> bool:
        """RPDO 1, NMT to it or to all, CANopen's SYNC, the heartbeat that the drive watches, and SDO writes."""
        if not plain(message):
            return False
        data = bytes(message.data[:2])
        if message.arbitration_id == 0:
            return data[1:] in (b"\0", bytes([self.node_id]))
        if message.arbitration_id == 0x600 + self.node_id:
            return data[:1] != b"" and data[0] >> 5 in _SDO_WRITES
        return message.arbitration_id in (0x200 + self.node_id, SYNC_ID, 0x700 + MASTER_NODE)

    def stops_s(self, speed_m_s: float) -> float:
        """The deadline of commands, and braking at half the required deceleration."""
        return 1e-3 * our.CARRIAGE_MAP.life_ms(speed_m_s) + 2 * abs(speed_m_s) / our.CARRIAGE_MAP.braking_m_s2


def state_of(statusword: int) -> int:
    """The state that a statusword shows, "not ready" by default."""
    known = enumerate(zip(_MASKS, _WORDS, strict=True))
    return next((state for state, (mask, word) in known if statusword & mask == word), NOT_READY)


def statusword_of(state: int, *, warning: bool = False) -> int:
    return _WORDS[state] | (WARNING if warning else 0)


def shown(statusword: int) -> int:
    """A drive's state in the catalogue's numbers; enabled with a warning or an active limit is derated."""
    state = _SHOWN[state_of(statusword)]
    return our.DERATED if state == our.ENABLED and statusword & (WARNING | LIMITED) else state


def mode_words(mode: int) -> str:
    return f"{mode} ({MODE_NAMES.get(mode, 'of the maker')})"


def fault_of(error: int) -> int:
    """An error code 0x603F as the catalogue's code of a fault: its own, its group's, or "internal"."""
    return _ERRORS.get(error, _ERRORS.get(error & 0xFF00, our.INTERNAL))


def controlword(mode: int, state: int, *, reset: bool = False) -> int:
    """The controlword to a drive in `state` for a `mode` of the catalogue's command: one step up at a time, never from
    below "ready to switch on" by `ENABLE`, never up with a `reset`. A moving drive is braked first; its voltage is
    disabled later.
    """
    if state == FAULTED:
        return RESET_FAULT if reset else DISABLE_VOLTAGE
    if state == OPERATION:
        return ENABLE_OPERATION if mode == our.ENABLE else HALT_QUICKLY
    if state == QUICK_STOPPING:
        return HALT_QUICKLY
    if mode in (our.OFF, our.QUICK_STOP) or state in (NOT_READY, REACTING):
        return DISABLE_VOLTAGE
    if state == DISABLED:
        return DISABLE_VOLTAGE if mode == our.ENABLE else SHUTDOWN
    if mode == our.ENABLE:
        return SWITCH_ON if state == READY_TO_SWITCH_ON else ENABLE_OPERATION
    return SHUTDOWN


def next_state(state: int, word: int, before: int, *, cause: bool, at_rest: bool) -> int:
    """The state after controlword `word` that follows `before`; `cause`: a fault's cause is present.

    Quick stop option 2: brake, then disabled. A fault ends by the rising edge of bit 7 once its cause is gone.
    """
    if cause and state not in (REACTING, FAULTED):
        return REACTING
    if state == REACTING:
        return FAULTED if at_rest else REACTING
    if state == FAULTED:
        edge = word & RESET_FAULT and not before & RESET_FAULT
        return DISABLED if edge and not cause else FAULTED
    if state == NOT_READY:
        return DISABLED
    if state == QUICK_STOPPING:
        return DISABLED if at_rest else QUICK_STOPPING
    return _commanded(state, word)


def _commanded(state: int, word: int) -> int:
    if not word & 0x02:
        return DISABLED
    if not word & 0x04:
        return QUICK_STOPPING if state == OPERATION else DISABLED
    if word & 0x07 == SHUTDOWN:
        return READY_TO_SWITCH_ON
    if state == DISABLED:
        return DISABLED
    if state == READY_TO_SWITCH_ON:
        return SWITCHED_ON
    return OPERATION if word & 0x0F == ENABLE_OPERATION else SWITCHED_ON
