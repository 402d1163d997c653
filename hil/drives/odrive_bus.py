"""An ODrive as the catalogue's carriage, on CANSimple: states, frames, limits, safe state."""

import math
from collections.abc import Mapping
from typing import Final

import can

from hil.bus.wrapping import plain
from hil.drives import odrive_protocol as wire
from hil.drives.carriage_bus import IDLE_TICKS, TurningBus
from hil.drives.odrive_protocol import FREE_NODES, Command, OdriveTable
from hil.nodes.frame_map import BOOT, ENABLED, FAULT, STANDBY, STOPPING, WAITING

_SAID: Final[Mapping[int, tuple[str, Command]]] = {
    wire.HEARTBEAT.number: ("CarriageHeartbeat", wire.HEARTBEAT),
    wire.GET_ERROR.number: ("CarriageFault", wire.GET_ERROR),
    wire.GET_ENCODER_ESTIMATES.number: ("CarriageFeedback", wire.GET_ENCODER_ESTIMATES),
}
"""Its frames and the catalogue's."""
_ASK_TICKS: Final = 10  # between two requests of closed loop control
_GIVE_UP_TICKS, _FAILED_TICKS = 250, 50
"""Ticks after which the request is given up, and after which a failed result is that of the request."""
_FORGIVEN: Final = 2  # heartbeats after an acknowledgement whose errors are ignored


class OdriveBus(TurningBus):
    """A command is sent with the next SYNC as Set_Input_Pos, which feeds the watchdog; estimates become feedback.

    The state is "ready" for an idle axis without errors after a request; "enable" then requests closed loop control.
    An error or a reason of disarming is latched until acknowledged, though the drive may forget it.
    """

    maker = "ODrive"
    table: OdriveTable

    def __init__(self, inner: can.BusABC, table: OdriveTable, tick_s: float) -> None:
        super().__init__(inner, table, tick_s)
        self._axis = self._errors = self._result = self._latched = self._forgiven = 0
        self._heard_at, self._others_at, self._others = -math.inf, -math.inf, set[int]()

    @property
    def wrong(self) -> str:
        silent = self._others_at - self._heard_at > 5 * wire.HEARTBEAT_S
        others = f"silent, but node {', '.join(map(str, sorted(self._others)))} speaks" if silent else ""
        return "; ".join(words for words in (wire.words_of(self._latched), self._left, others) if words)

    @property
    def _why(self) -> str:
        return "" if self._result in (wire.SUCCESS, wire.BUSY) else f" ({wire.result_of(self._result)})"

    @property
    def shown(self) -> int:
        if self._latched:
            return FAULT
        if self._axis == wire.CLOSED_LOOP:
            return ENABLED if self._armed else STOPPING
        if self._axis == wire.IDLE and not self._errors:
            return WAITING if self._armed else STANDBY
        return BOOT

    def synchronise(self, timeout: float | None) -> None:
        """Send the newest command once; request closed loop control while the axis is idle."""
        fresh, self._fresh = self._fresh, False
        if not fresh or not self._armed:
            return
        self._take_wanted(self._wanted_m if self._asked or math.isnan(self._last_m) else self._last_m)
        if self._axis != wire.CLOSED_LOOP:
            if self._asked % _ASK_TICKS == 0:
                self._tell(wire.SET_AXIS_STATE, timeout, wire.CLOSED_LOOP)
            self._asked += 1
            failed = self._result not in (wire.SUCCESS, wire.BUSY)
            if self._asked > (_FAILED_TICKS if failed else _GIVE_UP_TICKS):
                self._armed, self._left = False, f"it did not enter closed loop control{self._why}"
        self._position(self._wanted_m, self._rate_m_s, timeout)

    def acknowledge(self, timeout: float | None) -> None:
        """Clear_Errors; a persistent error is latched again."""
        self._latched, self._forgiven, self._left = 0, _FORGIVEN, ""
        self._tell(wire.CLEAR_ERRORS, timeout)

    def live(self, timeout: float | None) -> None:
        """Query the reason of disarming: the error itself may be gone before the next heartbeat."""
        self._tell(wire.GET_ERROR, timeout)

    def take(self, message: can.Message) -> bool:
        node, command, data = message.arbitration_id >> 5, message.arbitration_id & 0x1F, bytes(message.data)
        if not plain(message) or node not in FREE_NODES:
            return False
        if node != self.table.node_id:
            if command == wire.HEARTBEAT.number and len(data) == wire.HEARTBEAT.length:
                self._others_at = message.timestamp
                self._others.add(node)
            return False
        self._heard_at = stamp = message.timestamp
        name, frame = _SAID.get(command, ("", wire.ADDRESS))
        values = frame.read(data)
        if values is None:
            if command != wire.GET_ERROR.number or data:
                self.refuse(name, message)
        elif frame is wire.HEARTBEAT:
            self._beaten(values[0], values[1], values[2], stamp)
        elif frame is wire.GET_ERROR:
            self._failed(values[0] | values[1], stamp)
        elif frame is wire.GET_ENCODER_ESTIMATES:
            position_m, speed_m_s = (turns / self.table.turns_per_m for turns in values)
            if math.isfinite(position_m) and math.isfinite(speed_m_s):
                self._position_m, self._speed_m_s = position_m, speed_m_s
            self.feed(self.shown, position_m, speed_m_s, stamp)
        return True

    def _beaten(self, errors: int, axis: int, result: int, stamp: float) -> None:
        """A heartbeat: axis error, state, and the result of the last requested state."""
        self._result = result
        anew = bool(errors & wire.INITIALIZING) or axis == wire.UNDEFINED
        if self._led and (anew or (self._armed and axis != wire.CLOSED_LOOP)):
            self._armed = self._led = False
            self._left = "it booted anew" if anew else f"it left closed loop control by itself{self._why}"
        self._axis, self._errors = axis, errors
        self._led = self._led or (self._armed and axis == wire.CLOSED_LOOP)
        self._asked = 0 if axis == wire.CLOSED_LOOP else self._asked
        self._failed(errors & ~wire.INITIALIZING, stamp)
        self._forgiven = max(self._forgiven - 1, 0)
        self.beat(self.shown, stamp, anew=anew)

    def _failed(self, errors: int, stamp: float) -> None:
        """Latch active errors and the reason of disarming; the first ones become a fault."""
        if not errors or self._forgiven:
            return
        before, self._latched = self._latched, self._latched | errors
        if not before:
            self._armed, self._left = False, ""
            self.fail(wire.code_of(errors), errors.bit_length() - 1, stamp)

    def _rest(self, timeout: float | None) -> None:
        """Brake, then set the axis idle. If it does not become idle, silence leaves it to its watchdog."""
        if self._axis != wire.CLOSED_LOOP:
            return
        if (step := self._brake()) is not None:
            self._position(*step, timeout)
        elif self._stopped < IDLE_TICKS:
            self._stopped += 1
            self._tell(wire.SET_AXIS_STATE, timeout, wire.IDLE)

    def _position(self, position_m: float, rate_m_s: float, timeout: float | None) -> None:
        """Set_Input_Pos: position, and its rate in thousandths of a turn per second."""
        scale = self.table.turns_per_m
        ahead = min(max(round(wire.VEL_FF_SCALE * rate_m_s * scale), -32768), 32767)
        self._tell(wire.SET_INPUT_POS, timeout, position_m * scale, ahead, 0)

    def _tell(self, command: Command, timeout: float | None, *values: float) -> None:
        self.inner.send(command.to(self.table.node_id, *values), timeout)
