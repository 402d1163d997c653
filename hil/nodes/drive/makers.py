"""A carriage of another maker, simulated: what all of them have in common."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Final

import can

from controller.limits import Limits
from hil.nodes.drive.power_stage import CarriagePower
from hil.nodes.drive.state_machine import Stage

_AMBIENT_C: Final = 25.0  # of a laboratory


class MakersDrive(ABC):
    """Behaves as a `DriveNode` to the plant: `listen` once a slot, `output` for the plant's command.

    It is as hot as it is `heated_to_C`, its encoder shows what `misread` makes of the place, or nothing where it is
    `broken`, and it answers as `node_id`. `rejected` counts frames that were refused or not sent.
    """

    misread: Callable[[float], float] | None
    table: Any

    def __init__(self, bus: can.BusABC, table: Any, power: CarriagePower, limits: Limits, tick_s: float) -> None:
        self.bus, self.table, self.power, self.limits, self.tick_s = bus, table, power, limits, tick_s
        self.heated_to_C, self.misread, self.rejected = -math.inf, None, 0
        self.node_id, self.broken = table.node_id, False
        self.good_at, self.zero_m = -math.inf, 0.0
        self.boot(0.0)

    @abstractmethod
    def boot(self, now: float) -> None:
        """Begin anew, as after a loss of supply."""

    def configure(self, time_to_live_ms: int) -> None:  # noqa: B027 - most need none
        """Set it up in its own process, as its `set_up` would over the bus, for commands that live so long."""

    @property
    @abstractmethod
    def led(self) -> bool:
        """Whether it follows commands."""

    @property
    def safe(self) -> bool:
        """Whether it follows no command and is at rest."""
        return not self.led and self.power.at_rest

    @property
    def temperature_C(self) -> float:
        """Its temperature."""
        return max(_AMBIENT_C, self.heated_to_C)

    @property
    def shown_m(self) -> float:
        """Where its encoder shows the carriage."""
        place = self.power.output - self.zero_m
        return place if self.misread is None else self.misread(place)

    @property
    @abstractmethod
    def stage(self) -> Stage:
        """State and fault in the catalogue's numbers."""

    @abstractmethod
    def listen(self, now: float, slots: int) -> None:
        """One run of the firmware: take frames in, judge, report."""

    @abstractmethod
    def output(self, dt: float, sensed: float) -> float:
        """The plant's command for the next `dt` s."""

    def send(self, message: can.Message) -> None:
        """Send a frame, and count one that the bus does not take."""
        try:
            self.bus.send(message, 0)
        except (can.CanError, OSError):
            self.rejected += 1
