"""The table `[odrive]` of a deployment."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import can

from hil.nodes.frame_map import frames, plain
from hil.nodes.odrive import protocol as wire
from hil.nodes.turning import Turning
from models.parameter import nearest


@dataclass(frozen=True)
class OdriveTable(Turning):
    """`[odrive]`: the carriage is an ODrive of this `node_id`, whose motor does `turns_per_m` (negative: the other
    way). `firmware` and the two endpoint ids, of `flat_endpoints.json` of that firmware, are what its watchdog is read
    back by; that one must expire within `watchdog_s`. `coast_m_s2` is the deceleration of the carriage without torque,
    which is its safe state. `home` "here" makes the present place zero. `answers_s`: how long it may take to be found.
    `endpoints` are further ids of that file, by path, of `READ_BACK`.
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
    endpoints: tuple[tuple[str, int], ...] = ()

    def __post_init__(self) -> None:
        if self.node_id not in FREE_NODES:
            free = ", ".join(map(str, FREE_NODES))
            raise ValueError(
                f"odrive.node_id must be one of {free}, clear of the catalogue's identifiers and of {wire.BROADCAST},"
                f" which every ODrive hears; got {self.node_id}"
            )
        self.check("odrive", RANGES)

    def check_speed(self, speed_m_s: float) -> None:
        """Raises ValueError where Set_Input_Pos cannot carry the rate of `limits.carriage_speed_m_s`."""
        most = wire.LARGEST_VEL_FF / wire.VEL_FF_SCALE
        turns_s = abs(self.turns_per_m) * speed_m_s
        if turns_s > most:
            raise ValueError(
                f"odrive.turns_per_m times limits.carriage_speed_m_s must be at most {most:g} turns/s, all that Vel_FF"
                f" of Set_Input_Pos carries; got {turns_s:g}"
            )

    def orders(self, message: can.Message) -> bool:
        """Whether `message` is one by which a master commands this drive, or every one; to read an endpoint is a
        question.
        """
        node, command = message.arbitration_id >> 5, message.arbitration_id & 0x1F
        if not plain(message) or node not in (self.node_id, wire.BROADCAST) or command in wire.TOLD:
            return False
        return command != wire.RX_SDO or bytes(message.data[:1]) != b"\0"


RANGES: Final = (  # least and most of the table's keys
    ("turns_per_m", 1.0, 1e5),
    ("enable_watchdog_endpoint", 0, 65535),
    ("watchdog_timeout_endpoint", 0, 65535),
    ("watchdog_s", 0.004, 0.1),
    ("motor_current_A", 0.1, 200.0),
    ("coast_m_s2", 0.1, 100.0),
    ("answers_s", 0.1, 60.0),
)
_TAKEN: Final = {frame.id >> 5 for frame in frames().frames.values()}
FREE_NODES: Final = tuple(n for n in range(wire.BROADCAST) if n not in _TAKEN)
"""Nodes none of whose 32 identifiers is one of the catalogue's, but for that of all."""

READ_BACK: Final[Mapping[str, tuple[str, Callable[[OdriveTable, float], float]]]] = {
    "axis0.controller.config.control_mode": ("<B", lambda *_: wire.POSITION_CONTROL),
    "axis0.controller.config.input_mode": ("<B", lambda *_: wire.PASSTHROUGH),
    "axis0.controller.config.vel_limit": ("<f", lambda table, speed_m_s: abs(table.turns_per_m) * speed_m_s),
    "axis0.config.motor.current_soft_max": ("<f", lambda table, _: table.motor_current_A),
    "axis0.config.can.input_vel_scale": ("<I", lambda *_: wire.VEL_FF_SCALE),
    "axis0.controller.config.circular_setpoints": ("<?", lambda *_: 0),
}
"""What is read back where the drive's endpoint of that path is stated: its type, and what it must hold for a table and
a speed in m/s."""


def endpoints_of(raw: object) -> tuple[tuple[str, int], ...]:
    """`[odrive.endpoints]`: path and id of each. Raises ValueError."""
    if not isinstance(raw, Mapping):
        raise ValueError(f'odrive.endpoints must be a table of "path" = id; got {raw!r}')
    for path, number in raw.items():
        if path not in READ_BACK:
            raise ValueError(
                f"keys of [odrive.endpoints] must be among {', '.join(READ_BACK)}; got {path!r};"
                f" {nearest(str(path), list(READ_BACK))}"
            )
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= 65535:
            raise ValueError(f"odrive.endpoints {path} must be an integer in [1, 65535]; got {number!r}")
    return tuple(raw.items())
