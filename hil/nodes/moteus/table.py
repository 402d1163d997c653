"""The table `[moteus]`, and the names of what a moteus controller tells: faults and modes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import can

from hil.nodes.drive.state_machine import OVER_CURRENT, OVER_TEMPERATURE, TIME_TO_LIVE
from hil.nodes.moteus import registers as wire
from hil.nodes.turning import Turning

_SENSOR, _SUPPLY, _SELF_TEST, INTERNAL = 7, 9, 10, 11  # `Fault` of the catalogue
FAULTS: Final[Mapping[int, tuple[str, int]]] = {
    32: ("calibration fault", _SENSOR),
    33: ("motor driver fault", OVER_CURRENT),
    34: ("over voltage", _SUPPLY),
    35: ("encoder fault", _SENSOR),
    36: ("motor not configured", _SELF_TEST),
    37: ("pwm cycle overrun", INTERNAL),
    38: ("over temperature", OVER_TEMPERATURE),
    39: ("outside limit", INTERNAL),
    40: ("under voltage", _SUPPLY),
    41: ("config changed", INTERNAL),
    42: ("theta invalid", _SENSOR),
    43: ("position invalid", _SENSOR),
    44: ("driver enable fault", INTERNAL),
    45: ("stop position deprecated", INTERNAL),
    46: ("timing violation", INTERNAL),
    47: ("bemf feedforward no accel", INTERNAL),
    48: ("invalid limits", INTERNAL),
    49: ("position control error", INTERNAL),
    50: ("velocity control error", INTERNAL),
}
"""Fault codes of mode 1: names, and the catalogue's code of a fault. Codes from 96 on only tell a limit at work."""
WATCHDOG: Final = ("watchdog expired (mode 11, timeout)", TIME_TO_LIVE)


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

    @property
    def coast_turns_s2(self) -> float:
        """`coast_m_s2` at its output."""
        return self.coast_m_s2 * abs(self.turns_per_m)

    def orders(self, message: can.Message) -> bool:
        """Whether `message` is one by which a master commands this drive."""
        return wire.orders(message, self.node_id)


RANGES: Final = (  # least and most of the table's keys
    ("node_id", 1, 126),
    ("turns_per_m", 1.0, 1e5),
    ("most_torque_N_m", 0.001, 100.0),
    ("watchdog_s", 0.004, 0.1),
    ("coast_m_s2", 0.1, 100.0),
    ("answers_s", 0.1, 60.0),
)
