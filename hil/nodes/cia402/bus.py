"""A CiA 402 drive as the catalogue's carriage."""

from __future__ import annotations

import math
import struct
from typing import Final

import can

from hil.bus.catalogue import Catalogue
from hil.nodes.carriage_bus import CarriageBus
from hil.nodes.cia402.states import (
    ENABLE_OPERATION,
    FAULTED,
    HALT_QUICKLY,
    MASTER_NODE,
    OPERATION,
    OPERATIONAL,
    RPDO,
    SYNC_ID,
    TPDO_MORE,
    TPDO_STATE,
    Cia402Table,
    controlword,
    fault_of,
    shown,
    state_of,
)
from hil.nodes.frame_map import BOOT, ENABLED, FASTEST_M_S, STANDBY, STOPPING, plain

_ALIVE: Final = struct.pack("B", OPERATIONAL)
_NMT: Final = {4: STOPPING, OPERATIONAL: ENABLED, 127: STANDBY}


class Cia402Bus(CarriageBus):
    """Commands leave as RPDO 1, the drive's TPDOs and heartbeat come in as feedback, heartbeat and, where a fault
    begins, fault frames.

    A CiA 402 drive has no time to live in its commands: RPDO 1 has a deadline instead (`hil.nodes.cia402.setup`), which
    the same frames feed. Its warning shows as "derated".
    """

    def __init__(self, inner: can.BusABC, table: Cia402Table, catalogue: Catalogue, tick_s: float) -> None:
        super().__init__(inner, f"CiA 402 node {table.node_id}", catalogue, table.orders)
        self.table, self._tick_s, self._wanted_m = table, tick_s, math.nan
        self._takers = {
            0x180 + table.node_id: self._moved,
            0x280 + table.node_id: self._more,
            0x700 + table.node_id: self._beat,
        }
        self._statusword, self._speed_m_s, self._place = 0, 0.0, 0
        self._error = 0
        self._reset = self._told = self._known = False
        self._anew = ""

    @property
    def trouble(self) -> str:
        """The error code 0x603F of the drive's fault, or that it has booted."""
        told = f"error code 0x{self._error:04X}" if self._told else self._anew
        return f"cia402 node {self.table.node_id}: {told}" if told else ""

    def command(self, mode: int, place_m: float, timeout: float | None) -> None:
        """Controlword and target: the place, or the speed that leads there within the tick and, by
        `velocity_gain_Hz`, makes up for what the drive was off the place before.
        """
        word = controlword(mode, state_of(self._statusword), reset=self._reset)
        self._reset = False
        before, self._wanted_m = self._wanted_m, place_m if word == ENABLE_OPERATION else math.nan
        target = place_m
        if self.table.mode == "velocity":
            off = 0.0 if math.isnan(before) else before - self._place / self.table.counts_per_m
            rate = 0.0 if math.isnan(before) else (place_m - before) / self._tick_s
            target = min(max(rate + self.table.velocity_gain_Hz * off, -FASTEST_M_S), FASTEST_M_S)
        self._command(word, round(target * self.table.counts_per_m), timeout)

    def synchronise(self, timeout: float | None) -> None:
        """CANopen's own SYNC beside the catalogue's."""
        self.say(SYNC_ID, b"", timeout)

    def live(self, timeout: float | None) -> None:
        """The heartbeat that the drive watches."""
        self.say(0x700 + MASTER_NODE, _ALIVE, timeout)

    def acknowledge(self, timeout: float | None) -> None:
        """With the next command."""
        self._reset = True

    def halt(self, timeout: float | None) -> None:
        """Brake where it moves."""
        if state_of(self._statusword) == OPERATION:
            self._command(HALT_QUICKLY, 0 if self.table.mode == "velocity" else self._place, timeout)

    def take(self, message: can.Message) -> bool:
        """TPDOs and heartbeat of the node."""
        taker = self._takers.get(message.arbitration_id)
        if taker is None or not plain(message):
            return False
        if not taker(bytes(message.data), message.timestamp):
            self.refuse("CarriageHeartbeat" if taker == self._beat else "CarriageFeedback", message)
        return True

    def _moved(self, data: bytes, stamp: float) -> bool:
        """State and position: a feedback. As the next two it says whether the frame was as long as it must be."""
        if len(data) != TPDO_STATE.size:
            return False
        self._statusword, self._place = TPDO_STATE.unpack(data)
        self.feed(shown(self._statusword), self._place / self.table.counts_per_m, self._speed_m_s, stamp)
        return True

    def _more(self, data: bytes, stamp: float) -> bool:
        """Speed and error: with the next feedback, and as a fault where one begins."""
        if len(data) != TPDO_MORE.size:
            return False
        counts, error = TPDO_MORE.unpack(data)
        self._speed_m_s = counts / self.table.counts_per_m
        faulted = state_of(self._statusword) == FAULTED
        if faulted and not self._told:
            self._error = error
            self.fail(fault_of(error), error, stamp)
        self._told = faulted
        return True

    def _beat(self, data: bytes, stamp: float) -> bool:
        if len(data) != 1:
            return False
        self._anew = "it booted anew" if self._known and data[0] == 0 else self._anew
        self._known = True
        self.beat(_NMT.get(data[0] & 0x7F, BOOT), stamp, anew=data[0] == 0)
        return True

    def _command(self, word: int, counts: int, timeout: float | None) -> None:
        self.say(0x200 + self.table.node_id, RPDO.pack(word, min(max(counts, -(1 << 31)), (1 << 31) - 1)), timeout)
