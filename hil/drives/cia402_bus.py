"""A CiA 402 drive as the catalogue's carriage."""

import math
import struct
from typing import Final

import can

from hil.bus.wrapping import plain
from hil.drives import cia402_protocol as p402
from hil.drives.carriage_bus import CarriageBus
from hil.drives.cia402_protocol import Cia402Table
from hil.nodes.frame_map import BOOT, ENABLED, FASTEST_M_S, FAULT, INTERNAL, OFF, STANDBY, STOPPING

_ALIVE: Final = struct.pack("B", p402.OPERATIONAL)
_NMT: Final = {4: STOPPING, p402.OPERATIONAL: ENABLED, 127: STANDBY}
FOLLOWING_ERROR: Final = 0x8611  # 0x8611, CiA 402
_FOLLOWS_LATEST, _ASTRAY_REPORTS = 100, 2
"""Reports within which a drive must begin to follow (a brake opens), and reports in a row that show a later loss."""


class Cia402Bus(CarriageBus):
    """Commands are sent as RPDO 1, with its deadline as time to live; TPDOs and heartbeat become feedback, heartbeat
    and faults. A warning, or an active limit of the drive's own, is "derated". An enabled drive that reports that it
    does not follow its target (bit 12), or a following error (bit 13), has a fault, which is latched here.
    """

    maker = "CiA 402"
    table: Cia402Table

    def __init__(self, inner: can.BusABC, table: Cia402Table, tick_s: float) -> None:
        super().__init__(inner, table, tick_s)
        self._wanted_m = math.nan
        self._takers = {
            0x180 + table.node_id: self._moved,
            0x280 + table.node_id: self._more,
            0x700 + table.node_id: self._beat,
        }
        self._statusword, self._speed_m_s, self._counts = 0, 0.0, 0
        self._error = self._word = self._astray = 0
        self._followed, self._doubt = False, ""
        self._reset = self._reported = self._known = False
        self._anew = ""

    @property
    def wrong(self) -> str:
        limit = "it is at a limit of its own (bit 11 of its statusword; 0x607D, 0x607F)"
        words = [f"error code 0x{self._error:04X}" if self._reported else self._doubt or self._anew]
        words += [limit] if self._statusword & p402.LIMITED else []
        return "; ".join(word for word in words if word)

    def command(self, mode: int, position_m: float, timeout: float | None) -> None:
        """Send controlword and target: the position, or the speed that leads there and corrects the position error."""
        wanted = OFF if self._doubt else mode
        word = p402.controlword(wanted, p402.state_of(self._statusword), reset=self._reset)
        self._reset = False
        before, self._wanted_m = self._wanted_m, position_m if word == p402.ENABLE_OPERATION else math.nan
        target = position_m
        if self.table.mode == "velocity":
            off = 0.0 if math.isnan(before) else before - self._counts / self.table.counts_per_m
            rate = 0.0 if math.isnan(before) else (position_m - before) / self._tick_s
            target = min(max(rate + self.table.velocity_gain_Hz * off, -FASTEST_M_S), FASTEST_M_S)
        self._command(word, round(target * self.table.counts_per_m), timeout)

    def synchronise(self, timeout: float | None) -> None:
        self.say(p402.SYNC_ID, b"", timeout)

    def live(self, timeout: float | None) -> None:
        self.say(0x700 + p402.MASTER_NODE, _ALIVE, timeout)

    def acknowledge(self, timeout: float | None) -> None:
        self._reset, self._doubt = True, ""

    def halt(self, timeout: float | None) -> None:
        if p402.state_of(self._statusword) == p402.OPERATION:
            self._command(p402.HALT_QUICKLY, 0 if self.table.mode == "velocity" else self._counts, timeout)

    def take(self, message: can.Message) -> bool:
        taker = self._takers.get(message.arbitration_id)
        if taker is None or not plain(message):
            return False
        if not taker(bytes(message.data), message.timestamp):
            self.refuse("CarriageHeartbeat" if taker == self._beat else "CarriageFeedback", message)
        return True

    def _moved(self, data: bytes, stamp: float) -> bool:
        """State and position become a feedback. This method and the next two return whether the length is right."""
        if len(data) != p402.TPDO_STATE.size:
            return False
        self._statusword, self._counts = p402.TPDO_STATE.unpack(data)
        self._judge(stamp)
        self.feed(
            FAULT if self._doubt else p402.shown(self._statusword),
            self._counts / self.table.counts_per_m,
            self._speed_m_s,
            stamp,
        )
        return True

    def _judge(self, stamp: float) -> None:
        if p402.state_of(self._statusword) != p402.OPERATION or self._word != p402.ENABLE_OPERATION:
            self._followed, self._astray = False, 0
            return
        follows = bool(self._statusword & p402.FOLLOWS)
        self._followed, self._astray = self._followed or follows, 0 if follows else self._astray + 1
        if self._doubt:
            return
        if self.table.mode == "position" and self._statusword & p402.DEVIATES:
            self._doubt = "following error (bit 13 of its statusword; 0x6065, 0x6066)"
        elif self._astray >= (_ASTRAY_REPORTS if self._followed else _FOLLOWS_LATEST):
            self._doubt = "it does not follow its target (bit 12 of its statusword)"
        if self._doubt:
            self.fail(INTERNAL, FOLLOWING_ERROR, stamp)

    def _more(self, data: bytes, stamp: float) -> bool:
        """Speed and error: the next feedback has the speed, and a new error becomes a fault."""
        if len(data) != p402.TPDO_MORE.size:
            return False
        counts, error = p402.TPDO_MORE.unpack(data)
        self._speed_m_s = counts / self.table.counts_per_m
        faulted = p402.state_of(self._statusword) == p402.FAULTED
        if faulted and not self._reported:
            self._error = error
            self.fail(p402.fault_of(error), error, stamp)
        self._reported = faulted
        return True

    def _beat(self, data: bytes, stamp: float) -> bool:
        if len(data) != 1:
            return False
        self._anew = "it booted anew" if self._known and data[0] == 0 else self._anew
        self._known = True
        self.beat(_NMT.get(data[0] & 0x7F, BOOT), stamp, anew=data[0] == 0)
        return True

    def _command(self, word: int, counts: int, timeout: float | None) -> None:
        self._word = word
        self.say(0x200 + self.table.node_id, p402.RPDO.pack(word, min(max(counts, -(1 << 31)), (1 << 31) - 1)), timeout)
