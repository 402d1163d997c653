"""A carriage as a moteus controller, simulated after its maker's reference of registers and configuration and its
firmware: what `hil.nodes.moteus.actuator` sets up and leads, its frames read apart from it.
"""

import math
import struct
from typing import Final

import can

from controller.limits import Limits
from hil.bus.wrapping import fd_frame
from hil.nodes.drive.makers import MakersDrive
from hil.nodes.drive.node import MOST
from hil.nodes.drive.power_stage import CarriagePower
from hil.nodes.drive.state_machine import NO_FAULT, TIME_TO_LIVE, Stage
from hil.nodes.frame_map import ENABLED, FAULT, STANDBY
from hil.nodes.listening import waiting
from hil.nodes.moteus.multiplex import LINE, POLL, READ_ONLY, UNKNOWN, WRITE, Part, answer, error, parts
from hil.nodes.moteus.registers import SESSION, padded
from hil.nodes.moteus.table import FAULTS, MoteusTable
from hil.nodes.moteus.trajectory import MotorPath

# modes of moteus' reference
STOPPED, FAULTED, ENABLING, POSITION, TIMED_OUT, ZERO_VELOCITY, BRAKE = 0, 1, 2, 10, 11, 12, 15
ENCODER_FAULT, OVER_TEMPERATURE, NO_ACCELERATION_LIMIT = 35, 38, 47  # faults of the same
BOOT_S: Final = 0.03  # of the simulated drive
PREPARES_S: Final = 0.01
"""From the first command to position mode: modes 2 to 4, gate driver and zero of the current sensors."""
RELATIVE, ROTOR, OUTPUT = 0, 1, 2
"""Home states."""
DAMPED_S: Final = 0.02
"""Time constant with which the carriage is braked beside its friction, where no limit of acceleration leads it to rest:
the maker states none, it goes with gains or resistance and what is moved.
"""
_COMMAND: Final = {0x20: 0.0, 0x21: 0.0, 0x25: math.nan, 0x27: 0.0, 0x28: math.nan, 0x29: math.nan}
"""What a command holds of which nothing is written."""
_RESTING: Final = 1e-9  # turns/s
_LONGEST: Final = 64  # bytes of a frame
_SUPPLY_V: Final = 24.0  # of the simulated drive


class MoteusDrive(MakersDrive):
    """It speaks only when asked. `settings` are its configuration as shipped since firmware of March 2026. A command in
    position mode goes on at its rate until it ends with its watchdog, 0 meaning `default_timeout_s` and nan none: then
    mode 11, which brakes by `timeout_mode` and is latched until "stopped". A fault takes the torque away: the carriage
    coasts; "stopped" clears it. After a boot it knows its place at the output if an `output_encoder` is there, else
    within a turn of the rotor. What "conf set" wrote is lost then.
    """

    table: MoteusTable
    output_encoder = takes_prefix = True

    def __init__(
        self, bus: can.BusABC, table: MoteusTable, power: CarriagePower, limits: Limits, tick_s: float
    ) -> None:
        self.settings = {
            "servo.default_timeout_s": 0.1,
            "servo.timeout_mode": 12.0,
            "servo.default_velocity_limit": math.nan,
            "servo.default_accel_limit": 50.0,
            "servo.max_velocity": 500.0,
            "servo.bemf_feedforward": 0.0,
            "servo.bemf_feedforward_override": 0.0,
            "servo.fixed_voltage_mode": 0.0,
        }
        self.path = MotorPath()
        super().__init__(bus, table, power, limits, tick_s)

    def boot(self, now: float) -> None:
        """Begin anew, as after a loss of supply."""
        self.mode, self.fault, self.home = STOPPED, 0, OUTPUT if self.output_encoder else ROTOR
        self.held, self.prefix = dict(_COMMAND), 0
        self._now = self._since = self._began = self._prepared = now
        self.good_at = -math.inf
        self._stream = self._reply = b""
        self._commanded = False

    def configure(self, time_to_live_ms: int) -> None:
        """As `set_up` leaves it."""
        self.prefix = SESSION

    @property
    def watchdog_s(self) -> float:
        """The watchdog of the command that it holds."""
        return self.held[0x27]

    @watchdog_s.setter
    def watchdog_s(self, seconds: float) -> None:
        self.held[0x27] = seconds

    @property
    def led(self) -> bool:
        """Whether it is in position mode."""
        return self.mode == POSITION

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
        for message in waiting(self.bus, MOST):
            number, long = message.arbitration_id, message.arbitration_id > 0x7FF
            framed = message.is_fd and not message.is_error_frame and message.is_extended_id == long
            mine = number >> 16 == self.prefix and number & 0xFF in (self.node_id, 0x7F)
            if framed and mine and now - self._began >= BOOT_S:
                self._take(number >> 8 & 0xFF, bytes(message.data))
        self._judge()

    def output(self, dt: float, sensed: float) -> float:
        """The plant's command for the next `dt` s."""
        brakes = self.settings["servo.timeout_mode"] if self.mode == TIMED_OUT else self.mode
        slows = self.mode == TIMED_OUT and brakes == POSITION and not math.isnan(self.path.acceleration)
        follows = self.mode == POSITION or (slows and max(abs(self.path.rate), abs(self.power.rate)) > _RESTING)
        if follows:
            self.path.step(dt)
            self.power.aim(self.path.place / self.table.turns_per_m, dt)
        damped = abs(self.power.rate) / DAMPED_S if brakes in (POSITION, ZERO_VELOCITY, BRAKE) else 0.0
        self.power.braking_m_s2 = math.inf if slows else self.table.coast_m_s2 + damped
        return self.power.step(dt, float(follows), sensed)

    def _judge(self) -> None:
        """Faults, and the watchdog."""
        if self.mode == ENABLING and self._now >= self._prepared:
            self._become(POSITION)
            self.path.begin(self.power.output * self.table.turns_per_m, self.power.rate * self.table.turns_per_m)
            self._aim()
        wrong = ENCODER_FAULT if self.broken else 0
        wrong = OVER_TEMPERATURE if self.temperature_C > self.limits.temperature_C else wrong
        if wrong and self.mode not in (STOPPED, FAULTED):
            self._fail(wrong)
        if self.mode == POSITION and self._now - self.good_at > (
            self.watchdog_s or self.settings["servo.default_timeout_s"]
        ):
            self._become(TIMED_OUT)
            speed, acceleration = (self.settings[f"servo.default_{what}_limit"] for what in ("velocity", "accel"))
            self.path.command(math.nan, 0.0, speed, acceleration)

    def _take(self, source: int, data: bytes) -> None:
        """The subframes of a frame, in order, up to one that cannot be read, and the reply where one is wanted. A mode
        makes a command of what is written, once the frame is over.
        """
        self._reply, self._commanded = b"", False
        try:
            for part in parts(data):
                if not self._done(part):
                    break
        except (IndexError, ValueError, OverflowError, struct.error):
            self.rejected += 1
        if self._commanded:
            self._obey(int(self.held[0x00]))
        if source & 0x80:
            self._say(source & 0x7F, self._reply)

    def _done(self, part: Part) -> bool:
        """Do what a subframe says; whether the next one is read."""
        if part.kind == LINE:
            self._line(part.text)
        elif part.kind == POLL:
            some, self._stream = self._stream[: part.count], self._stream[part.count :]
            self._reply += bytes((0x41, part.first, len(some))) + some
        elif part.kind == WRITE:
            self._write(part)
        else:
            told, known = answer(part, self._register)
            self._reply += told
            return known
        return True

    def _write(self, part: Part) -> None:
        """Take values of registers in, and tell of those that are not for it."""
        for number, value in enumerate(part.values, part.first):
            if number == 0x00 and 0 <= value <= BRAKE:
                self.held, self._commanded = dict(_COMMAND) | {0x00: value}, True
            elif number in _COMMAND:
                self.held[number] = value
            elif number == 0x131 and math.isfinite(value):
                self.power.output, self.home = value / self.table.turns_per_m, OUTPUT
            elif not 0x20 <= number < 0x30:
                unknown = number == 0x00 or self._register(number) is None
                self._reply += error(0x30, number, UNKNOWN if unknown else READ_ONLY)

    def _obey(self, mode: int) -> None:
        """The command that a frame brought, in `mode`: faults and timeouts end by "stopped" alone."""
        if mode == STOPPED:
            self.fault = 0
            self._become(STOPPED)
        elif mode <= 4 or self.mode in (FAULTED, TIMED_OUT):
            return
        elif mode != POSITION:
            self._become(mode)
        elif self._unlimited_feedforward:
            self._fail(NO_ACCELERATION_LIMIT)
        else:
            self.good_at = self._now
            if self.mode == STOPPED:
                self._prepared = self._now + PREPARES_S
                self._become(ENABLING)
            elif self.mode != ENABLING:
                self._become(POSITION)
                self._aim()

    @property
    def _unlimited_feedforward(self) -> bool:
        """What the firmware does not take."""
        allowed = self.settings["servo.bemf_feedforward_override"] or not self.settings["servo.bemf_feedforward"]
        return not allowed and math.isnan(self._limit(0x29, "servo.default_accel_limit"))

    def _aim(self) -> None:
        """The command that is held, as a trajectory."""
        speed = self._limit(0x28, "servo.default_velocity_limit")
        acceleration = self._limit(0x29, "servo.default_accel_limit")
        if not (math.isnan(speed) and math.isnan(acceleration)):
            most = self.settings["servo.max_velocity"]
            speed = most if math.isnan(speed) else min(speed, most)
        if all(abs(self.held[number]) < 1e6 or math.isnan(self.held[number]) for number in (0x20, 0x21)):
            self.path.command(self.held[0x20], self.held[0x21], speed, acceleration)

    def _limit(self, number: int, setting: str) -> float:
        """A limit of the command: the configuration's where it is nan, none where it is negative."""
        value = self.settings[setting] if math.isnan(self.held[number]) else self.held[number]
        return math.nan if self.held[number] < 0 else value

    def _register(self, number: int) -> float | None:
        scale = math.nan if self.broken else self.table.turns_per_m
        known = {
            0x00: float(self.mode),
            0x01: self.shown_m * scale,
            0x02: self.power.rate * scale,
            0x03: 0.0,
            0x0C: float(self.home),
            0x0D: _SUPPLY_V,
            0x0E: self.temperature_C,
            0x0F: float(self.fault),
            0x38: self.path.place,
            0x39: self.path.rate,
        }
        return known[number] if number in known else self.held.get(number)

    def _line(self, text: bytes) -> None:
        """A line of the diagnostic stream."""
        words = text.decode("ascii", "replace").split()
        if words[:2] == ["conf", "get"] and words[-1] in self.settings:
            self._stream += f"{self.settings[words[-1]]:g}\r\n".encode()
        elif self.takes_prefix and words[:3] == ["conf", "set", "can.prefix"] and words[-1].isdecimal():
            self.prefix = int(words[-1]) & 0x1FFF
            self._stream += b"OK\r\n"
        else:
            self._stream += b"ERR unknown\r\n"

    def _fail(self, fault: int) -> None:
        self.fault = fault
        self._become(FAULTED)

    def _become(self, mode: int) -> None:
        if mode != self.mode:
            self.mode, self._since = mode, self._now

    def _say(self, destination: int, data: bytes) -> None:
        self.send(fd_frame(self.prefix << 16 | self.node_id << 8 | destination, padded(data[:_LONGEST])))
