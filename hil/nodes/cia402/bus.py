"""A bus on which a CiA 402 drive speaks as the catalogue's carriage: the controller behind it, its guard and its log
stay as they are.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from typing import Any, Final

import can

from hil.bus.catalogue import Catalogue
from hil.bus.codec import Codec
from hil.bus.protection import Sender
from hil.nodes.cia402.states import (
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
from hil.nodes.frame_map import FASTEST_M_S, plain

_ROOM_TEMPERATURE_C: Final = 20.0
_ALIVE: Final = struct.pack("B", OPERATIONAL)
_NODE_STATES: Final = {0: 0, 4: 3, OPERATIONAL: 2, 127: 1}
_SPOKEN: Final = ("CarriageFeedback", "CarriageHeartbeat", "CarriageFault")
_HEARD: Final = ("CarriageCommand", "ControllerHeartbeat", "DriveReset", "SafeStop", "Sync")


class Cia402Bus(can.BusABC):
    """Passes `inner` on, but for the carriage's frames: commands leave as RPDO 1, the drive's TPDOs and heartbeat come
    in as feedback, heartbeat and, where a fault begins, fault frames.

    A CiA 402 drive has no time to live in its commands: RPDO 1 has a deadline instead (`hil.nodes.cia402.setup`), which
    the same frames feed. It tells no temperature: it looks after that itself, and its warning shows as "derated". The
    frames made here are protected anew, so CRC and counter guard nothing beyond this process; on the wire CANopen has
    the bus's own CRC alone.
    """

    def __init__(self, inner: can.BusABC, table: Cia402Table, catalogue: Catalogue) -> None:
        super().__init__(channel=inner.channel_info)
        self.inner, self.table = inner, table
        self.channel_info = f"CiA 402 node {table.node_id} on {inner.channel_info}"
        self._names = {catalogue[name].id: name for name in _HEARD}
        self._codecs = {name: Codec(catalogue[name]) for name in _HEARD}
        self._speakers = {name: (catalogue[name].id, Sender(catalogue[name])) for name in _SPOKEN}
        self._fingerprint = catalogue.fingerprint
        self._takers = {
            0x180 + table.node_id: self._moved,
            0x280 + table.node_id: self._more,
            0x700 + table.node_id: self._beat,
        }
        self._ready: deque[can.Message] = deque()
        self._statusword, self._speed_m_s, self._place = 0, 0.0, 0
        self._began_s = math.nan
        self._reset = self._told = False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame of the catalogue, the carriage's as CANopen. Raises can.CanError as `inner`."""
        name = self._names.get(msg.arbitration_id, "")
        values = self._codecs[name].decode(int.from_bytes(msg.data, "little")) if name else None
        if not isinstance(values, dict):
            self.inner.send(msg, timeout)
        elif name == "CarriageCommand":
            word = controlword(int(values["Mode"]), state_of(self._statusword), reset=self._reset)
            self._reset = False
            self._command(word, round(values["Position_m"] * self.table.counts_per_m), timeout)
        elif name == "ControllerHeartbeat":
            self._say(0x700 + MASTER_NODE, _ALIVE, timeout)
        elif name == "DriveReset":
            self._reset = values["Target"] in (0, 1)
        elif name == "Sync":
            self.inner.send(msg, timeout)
            self._say(SYNC_ID, b"", timeout)
        else:
            if values["Target"] in (0, 1) and state_of(self._statusword) == OPERATION:
                self._command(HALT_QUICKLY, self._place, timeout)
            self.inner.send(msg, timeout)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame, the drive's own as the catalogue has it; None where there is none."""
        while not self._ready:
            message = self.inner.recv(timeout)
            if message is None:
                return None
            taker = self._takers.get(message.arbitration_id)
            if taker is None or not plain(message):
                return message
            taker(bytes(message.data), message.timestamp)
        return self._ready.popleft()

    def _moved(self, data: bytes, stamp: float) -> None:
        """State and position: a feedback."""
        if len(data) != TPDO_STATE.size:
            return
        self._statusword, self._place = TPDO_STATE.unpack(data)
        place = self._place / self.table.counts_per_m
        state = shown(self._statusword)
        temperature = {"State": float(state), "Temperature_degC": _ROOM_TEMPERATURE_C}
        self._hear("CarriageFeedback", {"Position_m": place, "Velocity_m_s": self._speed_m_s, **temperature}, stamp)

    def _more(self, data: bytes, stamp: float) -> None:
        """Speed and error: with the next feedback, and as a fault where one begins."""
        if len(data) != TPDO_MORE.size:
            return
        counts, error = TPDO_MORE.unpack(data)
        self._speed_m_s = min(max(counts / self.table.counts_per_m, -FASTEST_M_S), FASTEST_M_S)
        faulted = state_of(self._statusword) == FAULTED
        for _ in range(2 if faulted and not self._told else 0):
            self._hear("CarriageFault", {"Code": fault_of(error), "Detail": error}, stamp)
        self._told = faulted

    def _beat(self, data: bytes, stamp: float) -> None:
        if len(data) != 1:
            return
        self._began_s = stamp if math.isnan(self._began_s) or data[0] == 0 else self._began_s
        up = min(max(stamp - self._began_s, 0.0), 167772.0)
        state = _NODE_STATES.get(data[0] & 0x7F, 0)
        self._hear("CarriageHeartbeat", {"State": state, "Uptime_s": up, "Catalogue": self._fingerprint}, stamp)

    def _hear(self, name: str, values: dict[str, float], stamp: float) -> None:
        """Put a frame before the controller; one that does not fit its range is left out, as a corrupt one would be."""
        identifier, sender = self._speakers[name]
        try:
            data = sender.frame(values)
        except ValueError:
            return
        self._ready.append(can.Message(stamp, identifier, False, data=data, is_rx=True))

    def _command(self, word: int, counts: int, timeout: float | None) -> None:
        self._say(0x200 + self.table.node_id, RPDO.pack(word, min(max(counts, -(1 << 31)), (1 << 31) - 1)), timeout)

    def _say(self, identifier: int, data: bytes, timeout: float | None) -> None:
        self.inner.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data, is_rx=False), timeout)

    def send_periodic(self, *_: Any, **__: Any) -> Any:
        """Refused, as everywhere."""
        raise NotImplementedError("frames are sent one by one")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return self.recv(timeout), False

    def __del__(self) -> None:
        """Nothing to release, so nothing to warn of."""

    def shutdown(self) -> None:
        """Shut `inner` down."""
        super().shutdown()
        self.inner.shutdown()
