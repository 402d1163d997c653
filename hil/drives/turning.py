"""What the buses of drives have in common that count in turns, follow places and coast without torque."""

import math
from abc import abstractmethod
from typing import Final

import can

from hil.drives.carriage_bus import CarriageBus
from hil.drives.table import TurningTable
from hil.nodes.frame_map import ENABLE, QUICK_STOP_M_S2, READY, STANDBY

IDLE_TICKS: Final = 5  # how often a drive that has been braked is told to take its torque away
_SETTLE: Final = 2  # steps that a drive has to come to rest


class TurningBus(CarriageBus):
    """A command is held until the next SYNC; what stops the drive acts at once: the carriage is braked by places.

    It is armed from "ready" on, and was led once it has followed since. `_left` says why it was not led on, `_asked`
    counts the ticks in which it did not begin to follow, `_stopped` how often it was stopped.
    """

    def __init__(self, inner: can.BusABC, table: TurningTable, tick_s: float) -> None:
        super().__init__(inner, table, tick_s)
        self._place_m = self._speed_m_s = self._wanted_m = 0.0
        self._last_m = self._rate_m_s = math.nan
        self._armed = self._led = self._fresh = False
        self._asked, self._stopped, self._left = 0, 0, ""
        self._braking: tuple[float, float] | None = None
        self._rested = 0

    @property
    @abstractmethod
    def shown(self) -> int:
        """The drive's state in the catalogue's numbers."""

    def command(self, mode: int, place_m: float, timeout: float | None) -> None:
        """Held until the next SYNC; what stops the drive acts at once."""
        if mode == ENABLE and self._armed:
            self._wanted_m, self._fresh = place_m, True
        elif mode == READY and self.shown == STANDBY:
            self._arm()
        elif mode not in (READY, ENABLE):
            self._armed = False
        if not self._armed:
            self._rest(timeout)

    def halt(self, timeout: float | None) -> None:
        """Brake, with the next command: there is one a tick."""
        self._armed = False

    def _arm(self) -> None:
        self._armed, self._led, self._asked, self._left = True, False, 0, ""
        self._last_m, self._stopped = math.nan, 0

    @abstractmethod
    def _rest(self, timeout: float | None) -> None:
        """A step of the way to rest, and at rest to a drive that is stopped."""

    def _take_wanted(self, begin_m: float) -> None:
        """Go from `begin_m` to the wanted place within the tick."""
        self._rate_m_s, self._last_m = (self._wanted_m - begin_m) / self._tick_s, self._wanted_m
        self._braking, self._rested = None, 0

    def _brake(self) -> tuple[float, float] | None:
        """The next place and rate on the way to rest at `QUICK_STOP_M_S2`, from the last command on, else from where
        the drive is; None once it has had `_SETTLE` ticks to rest there.
        """
        if self._rested >= _SETTLE:
            return None
        moves = (self._place_m, self._speed_m_s) if math.isnan(self._last_m) else (self._last_m, self._rate_m_s)
        place, before = self._braking or moves
        rate = math.copysign(max(abs(before) - QUICK_STOP_M_S2 * self._tick_s, 0.0), before)
        self._braking = place + 0.5 * (before + rate) * self._tick_s, rate
        self._rested += before == 0.0
        return self._braking
