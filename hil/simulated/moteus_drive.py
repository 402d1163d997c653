"""A carriage as a moteus controller, simulated after its maker's reference and firmware."""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import can

from hil.bus.wrapping import fd_frame
from hil.drives import moteus_protocol as wire
from hil.drives.moteus_protocol import FAULTED, POSITION_MODE, STOPPED, TIMED_OUT, MoteusTable, Part
from hil.nodes.frame_map import ENABLED, FAULT, NO_FAULT, STANDBY, TIME_TO_LIVE
from hil.simulated.makers_drive import MakersDrive

_NO_LIMIT: Final = 1e9  # in turns and seconds


@dataclass
class MotorPath:
    """From a command on, `x = x_c + v_c t` is matched with at most `speed` (turns/s) and by accelerations of at most
    `acceleration` (turns/s2), nan where there is no limit. Without both, place and rate are the command's at once. A
    command without a place (nan) is one of speed alone.
    """

    place: float = 0.0
    rate: float = 0.0
    speed: float = math.nan
    acceleration: float = math.nan
    _target: float = math.nan
    _rate: float = 0.0

    def begin(self, place: float, rate: float) -> None:
        """Begin where the drive measures itself."""
        self.place, self.rate, self._target, self._rate = place, rate, math.nan, 0.0

    def command(self, place: float, rate: float, speed: float, acceleration: float) -> None:
        self.speed, self.acceleration = (limit if limit < _NO_LIMIT else math.nan for limit in (speed, acceleration))
        speed = self.speed
        rate = 0.0 if math.isnan(rate) else rate
        self._target, self._rate = place, rate if math.isnan(speed) else min(max(rate, -speed), speed)

    def step(self, dt: float) -> None:
        before, target = self.rate, self._target
        if math.isnan(self.speed) and math.isnan(self.acceleration):
            self.place, self.rate, self._target = target if math.isfinite(target) else self.place, self._rate, math.nan
            self.place += self.rate * dt
            return
        most = math.inf if math.isnan(self.acceleration) else self.acceleration * dt
        wanted = self._rate if math.isnan(target) else self._rate + self._closing(target - self.place, dt)
        if not math.isnan(self.speed):
            wanted = min(max(wanted, -self.speed), self.speed)
        self.rate = min(max(wanted, before - most), before + most)
        self.place += (self.rate if math.isinf(most) else 0.5 * (before + self.rate)) * dt
        self._target += self._rate * dt

    def _closing(self, gap: float, dt: float) -> float:
        """The speed beside the command's by which a gap closes in time, braking within the limit."""
        if math.isnan(self.acceleration):
            return gap / dt
        half = 0.5 * self.acceleration * dt
        return math.copysign(math.sqrt(half * half + 2.0 * self.acceleration * abs(gap)) - half, gap)


ENCODER_FAULT, OVER_TEMPERATURE, NO_ACCELERATION_LIMIT = 35, 38, 47  # in `FAULTS`
BOOT_S: Final = 0.03  # of the simulated drive
PREPARES_S: Final = 0.01
"""From the first command to position mode: modes 2 to 4, gate driver and zero of the current sensors."""
DAMPED_S: Final = 0.02
"""With which the carriage is braked beside its friction, where no limit leads it to rest; the maker states none."""
_COMMAND: Final = {
    wire.COMMAND_POSITION: 0.0,
    wire.COMMAND_VELOCITY: 0.0,
    wire.MAXIMUM_TORQUE: math.nan,
    wire.WATCHDOG_TIMEOUT: 0.0,
    wire.VELOCITY_LIMIT: math.nan,
    wire.ACCELERATION_LIMIT: math.nan,
}
"""What a command holds of which nothing is written."""
_RESTING: Final = 1e-9  # turns/s
_LONGEST: Final = 64  # bytes of a frame
_SUPPLY_V: Final = 24.0  # of the simulated drive
UNKNOWN, READ_ONLY = 1, 2  # error numbers of a register
# scale of int8, int16 and int32, of moteus' reference
_POSITION, _VELOCITY, _ACCELERATION = (0.01, 1e-4, 1e-5), (0.1, 0.00025, 1e-5), (0.05, 0.001, 1e-5)
# the same
_TORQUE, _TIME, _VOLTAGE, _TEMPERATURE = (0.5, 0.01, 0.001), (0.01, 0.001, 1e-6), (0.5, 0.1, 0.001), (1.0, 0.1, 0.001)
_SCALES: Final = {
    **dict.fromkeys((0x01, 0x20, 0x26, 0x38, 0x130, 0x131), _POSITION),
    **dict.fromkeys((0x02, 0x21, 0x28, 0x39), _VELOCITY),
    **dict.fromkeys((0x03, 0x22, 0x25), _TORQUE),
    wire.VOLTAGE: _VOLTAGE,
    wire.TEMPERATURE: _TEMPERATURE,
    wire.WATCHDOG_TIMEOUT: _TIME,
    wire.ACCELERATION_LIMIT: _ACCELERATION,
}
"""What one step of int8, int16 and int32 is worth; 1 where a register is a whole number."""


def from_raw(number: int, form: int, raw: float) -> float:
    """The value of a register that is written in `form`; the lowest integer says nan."""
    if form == wire.FLOAT:
        return raw
    lowest = -(1 << 8 * (1 << form) - 1)
    return math.nan if raw == lowest else raw * _SCALES.get(number, (1.0, 1.0, 1.0))[form]


def to_raw(number: int, form: int, value: float) -> float:
    """The same the other way."""
    if form == wire.FLOAT:
        return value
    most = (1 << 8 * (1 << form) - 1) - 1
    if math.isnan(value):
        return -most - 1
    return round(min(max(value / _SCALES.get(number, (1.0, 1.0, 1.0))[form], -most), most))


def answer(part: Part, register: Callable[[int], float | None]) -> tuple[bytes, bool]:
    """The reply to a question for registers, and whether there are all: else an error, and nothing more is read."""
    raw: list[float] = []
    for number in range(part.first, part.first + part.count):
        value = register(number)
        if value is None:
            return _error(wire.READ_ERROR, number, UNKNOWN), False
        raw.append(to_raw(number, part.form, value))
    told = wire.head(wire.REPLY, part.form, part.first, len(raw)) + wire.values_in(part.form, raw)
    return told if raw else b"", True


def _error(kind: int, number: int, code: int) -> bytes:
    return bytes((kind, *wire.varuint(number), code))


class MoteusDrive(MakersDrive):
    """It speaks only when asked. `settings` are its configuration as shipped since firmware of March 2026. A command in
    position mode goes on at its rate until its watchdog, 0 meaning `default_timeout_s` and nan none: then mode 11,
    which brakes by `timeout_mode` and is latched until "stopped". A fault takes the torque away: the carriage coasts;
    "stopped" clears it. After a boot it knows its place at the output if an `output_encoder` is there.
    """

    LED = POSITION_MODE
    table: MoteusTable
    output_encoder = takes_prefix = True

    def __init__(self, *how: Any) -> None:
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
        super().__init__(*how)

    def boot(self, now: float) -> None:
        """What "conf set" wrote is lost."""
        super().boot(now)
        self.state, self.fault, self.home = STOPPED, 0, wire.OUTPUT if self.output_encoder else wire.ROTOR
        self.held, self.prefix, self._prepared = dict(_COMMAND), 0, now
        self._stream = self._reply = b""
        self._commanded = False

    def configure(self, time_to_live_ms: int) -> None:
        """As `set_up` leaves it."""
        self.prefix = wire.SESSION

    @property
    def watchdog_s(self) -> float:
        """The watchdog of the command that it holds."""
        return self.held[wire.WATCHDOG_TIMEOUT]

    @watchdog_s.setter
    def watchdog_s(self, seconds: float) -> None:
        self.held[wire.WATCHDOG_TIMEOUT] = seconds

    def _stands(self) -> tuple[int, int]:
        if self.state == TIMED_OUT:
            return FAULT, TIME_TO_LIVE
        if self.state == FAULTED:
            return FAULT, wire.FAULTS[self.fault][1]
        return ENABLED if self.led else STANDBY, NO_FAULT

    def _hear(self, message: can.Message) -> None:
        number = message.arbitration_id
        mine = number >> 16 == self.prefix and number & 0xFF in (self.node_id, wire.BROADCAST)
        if wire.framed(message) and mine and self._now - self._began >= BOOT_S:
            self._take(number >> 8 & 0xFF, bytes(message.data))

    def output(self, dt: float, sensed: float) -> float:
        brakes = self.settings["servo.timeout_mode"] if self.state == TIMED_OUT else self.state
        slows = self.state == TIMED_OUT and brakes == POSITION_MODE and not math.isnan(self.path.acceleration)
        follows = self.state == POSITION_MODE or (slows and max(abs(self.path.rate), abs(self.power.rate)) > _RESTING)
        if follows:
            self.path.step(dt)
            self.power.aim(self.path.place / self.table.turns_per_m, dt)
        damped = abs(self.power.rate) / DAMPED_S if brakes in (POSITION_MODE, wire.ZERO_VELOCITY, wire.BRAKE) else 0.0
        self.power.braking_m_s2 = math.inf if slows else self.table.coast_m_s2 + damped
        return self.power.step(dt, float(follows), sensed)

    def _run(self) -> None:
        if self.state == wire.ENABLING and self._now >= self._prepared:
            self._become(POSITION_MODE)
            self.path.begin(self.power.output * self.table.turns_per_m, self.power.rate * self.table.turns_per_m)
            self._aim()
        wrong = ENCODER_FAULT if self.broken else 0
        wrong = OVER_TEMPERATURE if self.too_hot else wrong
        if wrong and self.state not in (STOPPED, FAULTED):
            self._fail(wrong)
        if self.state == POSITION_MODE and self._now - self.good_at > (
            self.watchdog_s or self.settings["servo.default_timeout_s"]
        ):
            self._become(TIMED_OUT)
            speed, acceleration = (self.settings[f"servo.default_{what}_limit"] for what in ("velocity", "accel"))
            self.path.command(math.nan, 0.0, speed, acceleration)

    def _take(self, source: int, data: bytes) -> None:
        """The subframes in order, up to one that cannot be read, and the reply; the mode acts at the end."""
        self._reply, self._commanded = b"", False
        try:
            for part in wire.parts(data):
                if not self._done(part):
                    break
        except (IndexError, ValueError, OverflowError, struct.error):
            self.rejected += 1
        if self._commanded:
            self._obey(int(self.held[wire.MODE]))
        if source & 0x80:
            self._say(source & 0x7F, self._reply)

    def _done(self, part: Part) -> bool:
        """Do what a subframe says; whether the next one is read."""
        if part.kind == wire.STREAM_TO_SERVO:
            self._line(part.text)
        elif part.kind == wire.STREAM_POLL:
            some, self._stream = self._stream[: part.count], self._stream[part.count :]
            self._reply += bytes((wire.STREAM_FROM_SERVO, part.first, len(some))) + some
        elif part.kind == wire.WRITE:
            self._write(part)
        elif part.kind == wire.READ:
            told, known = answer(part, self._register)
            self._reply += told
            return known
        else:
            raise ValueError(f"subframe {part.kind:#x} is none that a drive takes")
        return True

    def _write(self, part: Part) -> None:
        """Take values of registers in, and tell of those that are not for it."""
        for number, raw in enumerate(part.values, part.first):
            value = from_raw(number, part.form, raw)
            if number == wire.MODE and 0 <= value <= wire.BRAKE:
                self.held, self._commanded = dict(_COMMAND) | {wire.MODE: value}, True
            elif number in _COMMAND:
                self.held[number] = value
            elif number == wire.SET_OUTPUT_EXACT and math.isfinite(value):
                self.power.output, self.home = value / self.table.turns_per_m, wire.OUTPUT
            elif not 0x20 <= number < 0x30:
                unknown = number == wire.MODE or self._register(number) is None
                self._reply += _error(wire.WRITE_ERROR, number, UNKNOWN if unknown else READ_ONLY)

    def _obey(self, mode: int) -> None:
        """The command that a frame brought, in `mode`: faults and timeouts end by "stopped" alone."""
        if mode == STOPPED:
            self.fault = 0
            self._become(STOPPED)
        elif mode <= 4 or self.state in (FAULTED, TIMED_OUT):
            return
        elif mode != POSITION_MODE:
            self._become(mode)
        elif self._unlimited_feedforward:
            self._fail(NO_ACCELERATION_LIMIT)
        else:
            self.good_at = self._now
            if self.state == STOPPED:
                self._prepared = self._now + PREPARES_S
                self._become(wire.ENABLING)
            elif self.state != wire.ENABLING:
                self._become(POSITION_MODE)
                self._aim()

    @property
    def _unlimited_feedforward(self) -> bool:
        """What the firmware does not take."""
        allowed = self.settings["servo.bemf_feedforward_override"] or not self.settings["servo.bemf_feedforward"]
        return not allowed and math.isnan(self._limit(wire.ACCELERATION_LIMIT, "servo.default_accel_limit"))

    def _aim(self) -> None:
        """The command that is held, as a trajectory."""
        speed = self._limit(wire.VELOCITY_LIMIT, "servo.default_velocity_limit")
        acceleration = self._limit(wire.ACCELERATION_LIMIT, "servo.default_accel_limit")
        if not (math.isnan(speed) and math.isnan(acceleration)):
            most = self.settings["servo.max_velocity"]
            speed = most if math.isnan(speed) else min(speed, most)
        if all(
            abs(self.held[number]) < 1e6 or math.isnan(self.held[number])
            for number in (wire.COMMAND_POSITION, wire.COMMAND_VELOCITY)
        ):
            self.path.command(self.held[wire.COMMAND_POSITION], self.held[wire.COMMAND_VELOCITY], speed, acceleration)

    def _limit(self, number: int, setting: str) -> float:
        """A limit of the command: the configuration's where it is nan, none where it is negative."""
        value = self.settings[setting] if math.isnan(self.held[number]) else self.held[number]
        return math.nan if self.held[number] < 0 else value

    def _register(self, number: int) -> float | None:
        scale = math.nan if self.broken else self.table.turns_per_m
        known = {
            wire.MODE: float(self.state),
            wire.POSITION: self.shown_m * scale,
            wire.VELOCITY: self.power.rate * scale,
            wire.TORQUE: 0.0,
            wire.HOME_STATE: float(self.home),
            wire.VOLTAGE: _SUPPLY_V,
            wire.TEMPERATURE: self.temperature_C,
            wire.FAULT_CODE: float(self.fault),
            wire.PATH_POSITION: self.path.place,
            wire.PATH_VELOCITY: self.path.rate,
        }
        return known[number] if number in known else self.held.get(number)

    def _line(self, text: bytes) -> None:
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

    def _say(self, destination: int, data: bytes) -> None:
        self.send(fd_frame(self.prefix << 16 | self.node_id << 8 | destination, wire.padded(data[:_LONGEST])))
