"""A moteus controller as the catalogue's carriage, on CAN FD. Source: the maker's register reference."""

import math
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from typing import Final

import can

from hil.drives import moteus_protocol as wire
from hil.drives.carriage_bus import IDLE_TICKS, TurningBus
from hil.drives.moteus_protocol import FAULTS, WATCHDOG, MoteusTable
from hil.nodes.frame_map import BOOT, ENABLED, FAULT, INTERNAL, STANDBY, STOPPING, WAITING

_BEAT_S: Final = 0.015  # least time between two heartbeats
_FORGIVEN: Final = 3  # replies after an acknowledgement whose faults are ignored
_GIVE_UP_TICKS: Final = 250  # without the requested mode
_SILENT_S: Final = 0.012  # of silence after which an enabled drive may have rebooted and is not commanded further
_LOST_TICKS: Final = 50  # without a reply, after which its own can.prefix is tried too
_REMEMBERED: Final = 64  # commands sent recently
_BRAKE_TICKS: Final = 25  # for which a drive that left position mode is braked
_LONGEST: Final = 64  # bytes of a stop: a gateway that flips bits then mostly hits padding


class MoteusBus(TurningBus):
    """A command is sent with the next SYNC, as position mode with its own watchdog. The reply to each frame reports
    mode, position, speed, fault and the drive's current command; a command that was not sent stops the drive.

    The state is "ready" once the stopped drive has confirmed the watchdog; "enable" then begins position mode without
    the configuration's limits. "Stopped" clears a fault, so it is not sent until a latched fault is acknowledged.
    """

    maker = "moteus"
    table: MoteusTable

    def __init__(self, inner: can.BusABC, table: MoteusTable, tick_s: float) -> None:
        super().__init__(inner, table, tick_s)
        self._watchdog_s = wire.single(table.watchdog_s)
        self._servo, self._held_s = -1, math.nan
        self._prefix, self._in_session = wire.SESSION, False
        self._echoes = self._garbled = False
        self._sent: deque[tuple[float, ...]] = deque(maxlen=_REMEMBERED)
        self._braked, self._forgiven, self._unanswered = 0, 0, _LOST_TICKS
        self._latched, self._beat_at = "", -math.inf

    @property
    def wrong(self) -> str:
        return self._latched or self._left

    @property
    def shown(self) -> int:
        if self._latched:
            return FAULT
        if self._servo == wire.STOPPED:
            return WAITING if self._armed and self._held_s == self._watchdog_s else STANDBY
        if self._servo == wire.POSITION_MODE:
            return ENABLED if self._armed else STOPPING
        return WAITING if self._armed and 2 <= self._servo <= 4 else STOPPING if self._servo >= 0 else BOOT

    def _arm(self) -> None:
        rebooted = self._in_session and self._prefix != wire.SESSION
        if not rebooted:  # else its set-up is lost, and maybe its zero
            super()._arm()
            self._braked, self._garbled = 0, False

    def synchronise(self, timeout: float | None) -> None:
        """Send one frame: a new command, or the watchdog to a drive that is to become ready, or QUERY."""
        fresh, self._fresh = self._fresh, False
        self._unanswered += 1
        if self._unanswered > _LOST_TICKS:
            self._prefix = wire.SESSION - self._prefix
        if self._armed and self._led and self._silent:
            self._armed, self._left = False, "silent"
        if self._armed and fresh:
            self._lead(timeout)
        elif self._armed and self._servo == wire.STOPPED and self._held_s != self._watchdog_s:
            self._tell(wire.mode_write(wire.STOPPED) + wire.hold(self.table.watchdog_s) + wire.QUERY, timeout)
        else:
            self._tell(wire.QUERY, timeout)

    def acknowledge(self, timeout: float | None) -> None:
        """Stop, which clears a fault; a persistent one is latched again."""
        self._latched, self._left, self._forgiven = "", "", _FORGIVEN
        self._stop(timeout)

    def take(self, message: can.Message) -> bool:
        if wire.replier(message) != self.table.node_id:
            return False
        self._prefix, values = message.arbitration_id >> 16, wire.reported(bytes(message.data))
        self._in_session = self._in_session or self._prefix == wire.SESSION
        if wire.MODE in values and math.isfinite(values[wire.MODE]):
            self._replied(values, message.timestamp)
        elif not message.data or message.data[0] != wire.STREAM_FROM_SERVO:
            self.refuse("CarriageFeedback", message)
        return True

    def shutdown(self) -> None:
        """Restore the can.prefix of a stopped drive, so that its maker's tools find it."""
        if self._echoes and self._servo == wire.STOPPED and self._prefix == wire.SESSION:
            with suppress(can.CanError, OSError):
                self._tell(wire.stream("conf set can.prefix 0"), 0.1)
        super().shutdown()

    def _replied(self, values: Mapping[int, float], stamp: float) -> None:
        before, self._servo = self._servo, int(values[wire.MODE])
        self._held_s = values.get(wire.WATCHDOG_TIMEOUT, math.nan)
        self._led = self._led or (self._armed and self._servo == wire.POSITION_MODE)
        self._unanswered = 0
        if self._led and self._servo == wire.STOPPED and self._left == "silent":
            self._left = "it was silent, perhaps booted anew"
        elif self._led and self._armed and (doubt := self._doubt(values)):
            self._armed, self._left = False, doubt
        self._forgiven = max(self._forgiven - 1, 0)
        self._judge(int(values.get(wire.FAULT_CODE, 0.0)), stamp)
        scale = self.table.turns_per_m
        self._position_m = values.get(wire.POSITION, math.nan) / scale
        self._speed_m_s = values.get(wire.VELOCITY, math.nan) / scale
        self.feed(self.shown, self._position_m, self._speed_m_s, stamp)
        if stamp - self._beat_at >= _BEAT_S:
            self._beat_at = stamp
            self.beat(self.shown, stamp, anew=before < 0)

    def _doubt(self, values: Mapping[int, float]) -> str:
        """Why an enabled drive must be stopped, "" if it follows; `_judge` handles faults."""
        if self._servo == wire.STOPPED:
            return "it stopped by itself"
        if self._servo not in (wire.POSITION_MODE, wire.FAULTED, wire.TIMED_OUT):
            return f"it left position mode (mode {self._servo})"
        if tuple(values.get(register, math.nan) for register in wire.HELD) in self._sent:
            self._echoes = True
        elif self._echoes and self._servo == wire.POSITION_MODE:
            self._garbled = True
            return "it holds another command than it was sent"
        return ""

    def _judge(self, code: int, stamp: float) -> None:
        if self._servo not in (wire.FAULTED, wire.TIMED_OUT) or self._latched or self._forgiven:
            return
        timed_out = self._servo == wire.TIMED_OUT
        self._latched, ours = WATCHDOG if timed_out else FAULTS.get(code, (f"fault {code}", INTERNAL))
        self._armed, self._left = False, ""
        self.fail(ours, code, stamp)

    def _lead(self, timeout: float | None) -> None:
        """Position mode: in a straight line from the last position to the commanded one within the tick."""
        begin = self._wanted_m if self._servo != wire.POSITION_MODE else self._last_m
        self._take_wanted(begin)
        self._asked = 0 if self._servo == wire.POSITION_MODE else self._asked + 1
        if self._asked > _GIVE_UP_TICKS:
            self._armed, self._left = False, "it did not enter position mode"
        self._aim(begin, self._rate_m_s, timeout)

    def _rest(self, timeout: float | None) -> None:
        """Brake and stop an operating drive. One that does not answer, or gets garbled frames, might take a braking
        position for its first command: its phases are shorted instead. One that does not stop is only queried, so that
        its watchdog expires, if it has the right watchdog.
        """
        if self._latched or self._servo <= wire.FAULTED:
            return
        follows = self._servo == wire.POSITION_MODE and not (self._garbled or self._silent)
        step = self._brake() if follows else None
        if step is not None:
            self._aim(*step, timeout)
        elif not follows and self._braked < _BRAKE_TICKS and self._servo in (wire.POSITION_MODE, wire.BRAKE):
            self._braked += 1
            self._tell(wire.mode_write(wire.BRAKE), timeout, _LONGEST)
        elif self._stopped < IDLE_TICKS or self._held_s != self._watchdog_s:
            self._stopped += 1
            self._stop(timeout)

    @property
    def _silent(self) -> bool:
        return self._unanswered * self._tick_s > _SILENT_S

    def _stop(self, timeout: float | None) -> None:
        self._tell(wire.mode_write(wire.STOPPED), timeout, _LONGEST)

    def _aim(self, position_m: float, rate_m_s: float, timeout: float | None) -> None:
        scale, table = self.table.turns_per_m, self.table
        turns, rate = position_m * scale, rate_m_s * scale
        rest = (self._watchdog_s, wire.UNLIMITED, wire.UNLIMITED)
        self._sent.append((wire.single(turns), wire.single(rate), *rest))
        self._tell(wire.command(turns, rate, table.most_torque_N_m, table.watchdog_s), timeout)

    def _tell(self, data: bytes, timeout: float | None, least: int = 0) -> None:
        self.inner.send(wire.frame_to(self.table.node_id, data, self._prefix, least), timeout)
