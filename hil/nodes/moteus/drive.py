"""A carriage as a moteus controller, simulated after the maker's description of its registers: what
`hil.nodes.moteus.actuator` sets up and leads, its frames read apart from it.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Final

import can

from controller.limits import Limits
from hil.nodes.drive.power_stage import CarriagePower
from hil.nodes.drive.state_machine import NO_FAULT, TIME_TO_LIVE, Stage
from hil.nodes.frame_map import ENABLED, FAULT, QUICK_STOP_M_S2, STANDBY
from hil.nodes.listening import waiting
from hil.nodes.moteus.actuator import FAULTS, MoteusTable

STOPPED, FAULTED, POSITION, TIMED_OUT = 0, 1, 10, 11
ENCODER_FAULT, OVER_TEMPERATURE = 35, 38
BOOT_S: Final = 0.03
RELATIVE, OUTPUT = 0, 2
"""Home states."""
_MOST: Final = 256
_LONGEST: Final = 64
_AMBIENT_C: Final = 25.0
_SIZES: Final = (1, 2, 4, 4)
_KINDS: Final = ("b", "h", "i", "f")


class MoteusDrive:
    """Behaves as a `DriveNode` to the plant: `listen` once a slot, `output` for the plant's command.

    It speaks only when asked. A command in position mode ends with its watchdog, 0 meaning `default_timeout_s` and nan
    none: then mode 11, which brakes by `timeout_mode` and is latched until "stopped". A fault takes the torque away:
    the carriage coasts; "stopped" clears it. After a boot its place is relative to where it stands.
    """

    def __init__(
        self, bus: can.BusABC, table: MoteusTable, power: CarriagePower, limits: Limits, tick_s: float
    ) -> None:
        self.bus, self.table, self.power, self.limits, self.tick_s = bus, table, power, limits, tick_s
        self.heated_to_C, self.misread = -math.inf, None
        self.node_id, self.broken = table.node_id, False
        self.settings = {"servo.default_timeout_s": 0.1, "servo.timeout_mode": 12.0}
        self.rejected = 0
        self.boot(0.0)

    misread: Callable[[float], float] | None

    def boot(self, now: float) -> None:
        """Begin anew, as after a loss of supply."""
        self.mode, self.fault, self.home = STOPPED, 0, OUTPUT
        self.watchdog_s = 0.0
        self._now = self._since = self._began = now
        self.good_at = -math.inf
        self._stream = b""

    @property
    def safe(self) -> bool:
        """Whether the drive follows no command and is at rest."""
        return self.mode != POSITION and self.power.at_rest

    @property
    def temperature_C(self) -> float:
        """Temperature of its board."""
        return max(_AMBIENT_C, self.heated_to_C)

    @property
    def stage(self) -> Stage:
        """State and fault in the catalogue's numbers."""
        if self.mode == TIMED_OUT:
            return Stage(FAULT, self._since, TIME_TO_LIVE)
        if self.mode == FAULTED:
            return Stage(FAULT, self._since, FAULTS[self.fault][1])
        return Stage(ENABLED if self.mode == POSITION else STANDBY, self._since, NO_FAULT)

    def listen(self, now: float, slots: int) -> None:
        """One run of the firmware: take frames in, judge, answer."""
        self._now = now
        for message in waiting(self.bus, _MOST):
            long = message.arbitration_id > 0x7FF
            framed = message.is_fd and not message.is_error_frame and message.is_extended_id == long
            if framed and message.arbitration_id & 0xFF == self.node_id and now - self._began >= BOOT_S:
                try:
                    self._take(message.arbitration_id >> 8, bytes(message.data))
                except (IndexError, ValueError, OverflowError, struct.error):
                    self.rejected += 1
        self._judge()

    def output(self, dt: float, sensed: float) -> float:
        """The plant's command for the next `dt` s."""
        self.power.braking_m_s2 = QUICK_STOP_M_S2 if self.mode == TIMED_OUT else self.table.coast_m_s2
        return self.power.step(dt, float(self.mode == POSITION), sensed)

    def _judge(self) -> None:
        """Faults, and the watchdog."""
        wrong = ENCODER_FAULT if self.broken else 0
        wrong = OVER_TEMPERATURE if self.temperature_C > self.limits.temperature_C else wrong
        if wrong and self.mode == POSITION:
            self.fault = wrong
            self._become(FAULTED)
        lives_s = self.settings["servo.default_timeout_s"] if self.watchdog_s == 0.0 else self.watchdog_s
        if self.mode == POSITION and self._now - self.good_at > lives_s:
            self._become(TIMED_OUT)

    def _take(self, source: int, data: bytes) -> None:
        """The subframes of a frame, in order, and the reply where one is wanted."""
        reply, at = b"", 0
        wrote: dict[int, float] = {}
        while at < len(data) and data[at] != 0x50:
            kind = data[at]
            if kind == 0x40:
                self._line(data[at + 3 : at + 3 + data[at + 2]])
                at += 3 + data[at + 2]
                continue
            if kind == 0x42:
                some, self._stream = self._stream[: data[at + 2]], self._stream[data[at + 2] :]
                reply += bytes((0x41, data[at + 1], len(some))) + some
                at += 3
                continue
            count, form, at = kind & 3, kind >> 2 & 3, at + 1
            if not count:
                count, at = data[at], at + 1
            first, at = data[at] & 0x7F, at + 1
            if data[at - 1] & 0x80:
                first, at = first | data[at] << 7, at + 1
            if kind & 0xF0 == 0x00:
                size = _SIZES[form]
                for k in range(count):
                    wrote[first + k] = struct.unpack_from("<" + _KINDS[form], data, at)[0]
                    at += size
                    if first + k == 0x00:
                        self.watchdog_s = 0.0
            elif kind & 0xF0 == 0x10:
                self._obey(wrote)
                wrote = {}
                values = [self._register(first + k) for k in range(count)]
                numbers = [v if form == 3 else round(v) for v in values]
                reply += bytes((0x20 | form << 2 | count, first)) + struct.pack(f"<{count}{_KINDS[form]}", *numbers)
            else:
                self.rejected += 1
                return
        self._obey(wrote)
        if source & 0x80:
            self._say(source & 0x7F, reply)

    def _obey(self, wrote: dict[int, float]) -> None:
        """The registers that one frame wrote: a mode makes a command of them."""
        if 0x27 in wrote:
            self.watchdog_s = wrote[0x27]
        if 0x131 in wrote and self.mode != POSITION:
            self.power.output, self.home = wrote[0x131] / self.table.turns_per_m, OUTPUT
        if wrote.get(0x00) == STOPPED:
            self.fault = 0
            self._become(STOPPED)
        elif wrote.get(0x00) == POSITION and self.mode in (STOPPED, POSITION):
            self.good_at = self._now
            self._become(POSITION)
            place, rate = wrote.get(0x20, 0.0), wrote.get(0x21, 0.0)
            if math.isfinite(place) and math.isfinite(rate):
                self.power.aim((place + rate * self.tick_s) / self.table.turns_per_m, self.tick_s)

    def _register(self, number: int) -> float:
        place, scale = self.power.output, self.table.turns_per_m
        place = place if self.misread is None else self.misread(place)
        known = {
            0x00: float(self.mode),
            0x01: math.nan if self.broken else place * scale,
            0x02: math.nan if self.broken else self.power.rate * scale,
            0x0C: float(self.home),
            0x0F: float(self.fault),
            0x27: self.watchdog_s,
        }
        return known.get(number, 0.0)

    def _line(self, text: bytes) -> None:
        """A line of the diagnostic stream."""
        words = text.decode("ascii", "replace").split()
        if words[:2] == ["conf", "get"] and words[-1] in self.settings:
            self._stream += f"{self.settings[words[-1]]:g}\r\n".encode()
        else:
            self._stream += b"ERR unknown\r\n"

    def _become(self, mode: int) -> None:
        if mode != self.mode:
            self.mode, self._since = mode, self._now

    def _say(self, destination: int, data: bytes) -> None:
        data = data[:_LONGEST]
        length = next(n for n in (*range(9), 12, 16, 20, 24, 32, 48, _LONGEST) if n >= len(data))
        identifier = self.node_id << 8 | destination
        message = can.Message(
            arbitration_id=identifier,
            is_extended_id=identifier > 0x7FF,
            is_fd=True,
            bitrate_switch=True,
            data=data + bytes([0x50]) * (length - len(data)),
            is_rx=False,
        )
        try:
            self.bus.send(message, 0)
        except (can.CanError, OSError):
            self.rejected += 1
