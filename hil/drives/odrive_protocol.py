"""The table `[odrive]` and CANSimple of firmware 0.6. Source: the maker's CAN protocol page, DBC and enumerations."""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final

import can
from pydantic import BeforeValidator, Field

from hil.bus.wrapping import classic_frame, plain
from hil.drives.table import CODES, NODE, TurningTable, faults_of
from hil.nodes.frame_map import INTERNAL, frames
from models.files.toml import check_known
from models.rigs.schema import key


@dataclass(frozen=True)
class Command:
    """A frame: the 5 lower bits of its identifier, its signals in struct's notation, its least `length` in bytes."""

    number: int
    layout: str = "<"
    length: int = 0

    def to(self, node: int, *values: float, more: bytes = b"") -> can.Message:
        """The frame with these values, then `more`; a frame with signals but without values is a query."""
        asks = not values and self.layout != "<"
        data = b"" if asks else (struct.pack(self.layout, *values) + more).ljust(self.length, b"\0")
        return classic_frame(node << 5 | self.number, data)

    def read(self, data: bytes) -> tuple[Any, ...] | None:
        """The values of a frame, None for one that is too short."""
        return struct.unpack_from(self.layout, data) if len(data) >= struct.calcsize(self.layout) else None


# as the maker's CAN protocol has them
GET_VERSION = Command(0x00, "<8B")  # the last but one three are the firmware's
HEARTBEAT = Command(0x01, "<IBBB", 8)  # axis error, axis state, procedure result, trajectory done
ESTOP, ADDRESS, CLEAR_ERRORS = Command(0x02), Command(0x06), Command(0x18, length=1)
GET_ERROR = Command(0x03, "<II")  # active errors, reason of a disarming
RX_SDO, TX_SDO = Command(0x04, "<BHB"), Command(0x05, "<BHB")  # opcode, endpoint, reserved; then its value
SET_AXIS_STATE = Command(0x07, "<I", 8)
GET_ENCODER_ESTIMATES = Command(0x09, "<ff")  # turns, turns/s
SET_CONTROLLER_MODE = Command(0x0B, "<II")  # control and input mode
SET_INPUT_POS = Command(0x0C, "<fhh")  # turns, rate in thousandths of a turn a second, torque
SET_LIMITS = Command(0x0F, "<ff")  # turns/s, A
SET_ABSOLUTE_POSITION = Command(0x19, "<f", 8)
_SPOKEN: Final = (GET_VERSION, HEARTBEAT, GET_ERROR, TX_SDO, ADDRESS, GET_ENCODER_ESTIMATES)
SENT_BY_DRIVE: Final = (*(one.number for one in _SPOKEN), 0x14, 0x15, 0x17, 0x1C, 0x1D)
"""Frames that the drive sends, on request or by itself."""
BROADCAST: Final = 63  # the node number of all drives, and of a drive without an address
UNDEFINED, IDLE, CLOSED_LOOP = 0, 1, 8  # axis states
AXIS_STATES: Final = {int(state): words for state, words in CODES["odrive"]["axis_states"].items()}
"""Axis states in words; the motor has a current in all but the first two."""
SUCCESS, BUSY, DISARMED, INVALID_STATE, NOT_CALIBRATED = 0, 1, 3, 13, 14  # places in `RESULTS`
RESULTS: Final[list[str]] = CODES["odrive"]["results"]
"""Procedure_Result of the heartbeat: the result of the last requested axis state."""
POSITION_CONTROL, PASSTHROUGH = 3, 1  # control and input mode
VEL_FF_SCALE: Final = 1000  # vel_FF in a turn a second, as axis0.config.can.input_vel_scale is shipped
LARGEST_VEL_FF: Final = 32767  # of a signed word of 16 bits
HEARTBEAT_S: Final = 0.02  # period that is set
INITIALIZING: Final = 1  # bit of ODrive.Error
ERRORS: Final = faults_of(CODES["odrive"]["errors"])
"""The bits of an axis error: name, and the catalogue's code of the fault."""


def words_of(errors: int) -> str:
    known = [name for bit, (name, _) in ERRORS.items() if errors & bit]
    rest = errors & ~(INITIALIZING | sum(ERRORS))
    return ", ".join([*known, *([f"error 0x{rest:X}"] if rest else [])])


def code_of(errors: int) -> int:
    return next((code for bit, (_, code) in ERRORS.items() if errors & bit), INTERNAL)


def result_of(result: int) -> str:
    return RESULTS[result] if result < len(RESULTS) else f"result {result}"


_TAKEN: Final = {frame.id >> 5 for frame in frames().frames.values()}
FREE_NODES: Final = tuple(n for n in range(BROADCAST) if n not in _TAKEN)
"""Nodes whose 32 identifiers are all free in the catalogue, without the broadcast."""


def _endpoints(raw: object) -> object:
    if not isinstance(raw, Mapping):
        return raw
    for path, number in raw.items():
        check_known([path], READ_BACK, "must have keys among")
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= 65535:
            raise ValueError(f"{path} must be an integer in [1, 65535]; got {number!r}")
    return tuple(raw.items())


class OdriveTable(TurningTable):
    """`[odrive]`: an ODrive; its safe state is no torque. `endpoints`: ids by path of `READ_BACK`."""

    where = "odrive"
    node_id: Annotated[int, Field(json_schema_extra={"enum": list(FREE_NODES)})] = key(NODE, 2)
    firmware: str = key("its firmware, for which the endpoint ids are valid; any other one is refused", "0.6.11")
    enable_watchdog_endpoint: int = key(
        "endpoint id of `axis0.config.enable_watchdog` in its `flat_endpoints.json`; with 0 the drive is refused",
        0,
        0,
        65535,
    )
    watchdog_timeout_endpoint: int = key("endpoint id of `axis0.config.watchdog_timeout`, likewise", 0, 0, 65535)
    motor_current_A: float = key("maximum current of its motor (Set_Limits)", 10.0, 0.1, 200.0)
    endpoints: Annotated[tuple[tuple[str, int], ...], BeforeValidator(_endpoints)] = key(
        'further ids of `flat_endpoints.json`, `"path" = id`, to read back (`docs/deployment.md` lists the settings);'
        " the set-up names those without an id",
        (),
    )

    def model_post_init(self, _: Any) -> None:
        if self.node_id not in FREE_NODES:
            free = f"{', '.join(map(str, FREE_NODES))}, clear of the catalogue's identifiers and of the broadcast"
            raise ValueError(f"odrive.node_id must be one of {free}; got {self.node_id}")

    def check_speed(self, speed_m_s: float) -> None:
        """Raises ValueError if Set_Input_Pos cannot carry the rate of `limits.carriage_speed_m_s`."""
        most, turns_s = LARGEST_VEL_FF / VEL_FF_SCALE, abs(self.turns_per_m) * speed_m_s
        if turns_s > most:
            product = "odrive.turns_per_m times limits.carriage_speed_m_s"
            raise ValueError(f"{product} must be at most {most:g} turns/s, the range of Vel_FF; got {turns_s:g}")

    def orders(self, message: can.Message) -> bool:
        """Any frame to this drive or to all, except reading an endpoint."""
        node, command = message.arbitration_id >> 5, message.arbitration_id & 0x1F
        if not plain(message) or node not in (self.node_id, BROADCAST) or command in SENT_BY_DRIVE:
            return False
        return command != RX_SDO.number or bytes(message.data[:1]) != b"\0"

    def identifiers(self) -> tuple[frozenset[int], frozenset[int]]:
        both = frozenset(self.node_id << 5 | command for command in range(32))
        return both, both


READ_BACK: Final[Mapping[str, tuple[str, Callable[[OdriveTable, float], float]]]] = {
    "axis0.controller.config.control_mode": ("<B", lambda *_: POSITION_CONTROL),
    "axis0.controller.config.input_mode": ("<B", lambda *_: PASSTHROUGH),
    "axis0.controller.config.vel_limit": ("<f", lambda table, speed_m_s: abs(table.turns_per_m) * speed_m_s),
    "axis0.config.motor.current_soft_max": ("<f", lambda table, _: table.motor_current_A),
    "axis0.config.can.input_vel_scale": ("<I", lambda *_: VEL_FF_SCALE),
    "axis0.controller.config.circular_setpoints": ("<?", lambda *_: 0),
}
"""By path of an endpoint: its type, and its required value for a table and a speed in m/s."""
