"""The common part of simulated drives of other makers."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Final

import can

from controller.limits import Limits
from hil.bus.wrapping import waiting
from hil.simulated.power_stage import CarriagePower
from hil.simulated.state_machine import Stage

MOST: Final = 256  # frames that a firmware receives in one run
AMBIENT_C: Final = 25.0  # of a laboratory


class MakersDrive(ABC):
    """Behaves as a `DriveNode` to the plant. `state` is in its maker's numbers, `LED` the one in which it follows.
    `heated_to_C` raises its temperature; its encoder shows `misread` of the position, or nothing while it is `broken`;
    it answers as `node_id`. `rejected` counts frames that were refused or not sent.
    """

    LED: int
    misread: Callable[[float], float] | None = None
    heated_to_C, rejected, broken = -math.inf, 0, False
    state = 0

    def __init__(self, bus: can.BusABC, table: Any, power: CarriagePower, limits: Limits, tick_s: float) -> None:
        self.bus, self.table, self.power, self.limits, self.tick_s = bus, table, power, limits, tick_s
        self.node_id = table.node_id
        self.boot(0.0)

    def boot(self, now: float) -> None:
        self.good_at, self.zero_m = -math.inf, 0.0
        self._now = self._since = self._began = now

    def configure(self, time_to_live_ms: int) -> None:  # noqa: B027 - most need none
        """Set it up without the bus, as its `set_up` would, for commands with this time to live."""

    @property
    def led(self) -> bool:
        return self.state == self.LED

    @property
    def safe(self) -> bool:
        """Whether it is at rest and follows no command."""
        return not self.led and self.power.at_rest

    @property
    def temperature_C(self) -> float:
        return max(AMBIENT_C, self.heated_to_C)

    @property
    def too_hot(self) -> bool:
        return self.temperature_C > self.limits.temperature_C

    @property
    def shown_m(self) -> float:
        position = self.power.output - self.zero_m
        return position if self.misread is None else self.misread(position)

    @property
    def stage(self) -> Stage:
        state, fault = self._stands()
        return Stage(state, self._since, fault)

    @abstractmethod
    def _stands(self) -> tuple[int, int]:
        """State and fault of `stage`."""

    def listen(self, now: float, slots: int) -> None:
        self._now = now
        for message in waiting(self.bus, MOST):
            self._hear(message)
        self._run()

    @abstractmethod
    def _hear(self, message: can.Message) -> None:
        """Process a received frame."""

    @abstractmethod
    def _run(self) -> None:
        """Judge, step the state, report."""

    @abstractmethod
    def output(self, dt: float, sensed: float) -> float:
        """The plant's command for the next `dt` s."""

    def _become(self, state: int) -> None:
        if state != self.state:
            self.state, self._since = state, self._now

    def send(self, message: can.Message) -> None:
        try:
            self.bus.send(message, 0)
        except (can.CanError, OSError):
            self.rejected += 1
