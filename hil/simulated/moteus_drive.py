"""A simulated moteus controller as the carriage, after its maker's reference and firmware."""

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
    """The trajectory that a moteus makes of its commands. A command's line `x = x_c + v_c t` is reached with at most
    `speed` (turns/s) and `acceleration` (turns/s2), nan: no limit; without limits at once. A command whose position is
    nan has only a speed.
    """

    position: float = 0.0
    rate: float = 0.0
    speed: float = math.nan
    acceleration: float = math.nan
    _target: float = math.nan
    _rate: float = 0.0

    def begin(self, position: float, rate: float) -> None:
        self.position, self.rate, self._target, self._rate = position, rate, math.nan, 0.0

    def command(self, position: float, rate: float, speed: float, acceleration: float) -> None:
        self.speed, self.acceleration = (limit if limit < _NO_LIMIT else math.nan for limit in (speed, acceleration))
        speed = self.speed
        rate = 0.0 if math.isnan(rate) else rate
        self._target, self._rate = position, rate if math.isnan(speed) else min(max(rate, -speed), speed)

    def step(self, dt: float) -> None:
        before, target = self.rate, self._target
        if math.isnan(self.speed) and math.isnan(self.acceleration):
            self.position, self.rate, self._target = (
                target if math.isfinite(target) else self.position,
                self._rate,
                math.nan,
            )
            self.position += self.rate * dt
            return
        most = math.inf if math.isnan(self.acceleration) else self.acceleration * dt
        wanted = self._rate if math.isnan(target) else self._rate + self._closing(target - self.position, dt)
        if not math.isnan(self.speed):
            wanted = min(max(wanted, -self.speed), self.speed)
        self.rate = min(max(wanted, before - most), before + most)
        self.position += (self.rate if math.isinf(most) else 0.5 * (before + self.rate)) * dt
        self._target += self._rate * dt

    def _closing(self, gap: float, dt: float) -> float:
        """The speed, added to the command's, that closes a gap while braking within the limit."""
        if math.isnan(self.acceleration):
            return gap / dt
        half = 0.5 * self.acceleration * dt
        return math.copysign(math.sqrt(half * half + 2.0 * self.acceleration * abs(gap)) - half, gap)


ENCODER_FAULT, OVER_TEMPERATURE, NO_ACCELERATION_LIMIT = 35, 38, 47  # in `FAULTS`
BOOT_S: Final = 0.03  # of the simulated drive
PREPARES_S: Final = 0.01
"""From the first command to position mode: modes 2 to 4, gate driver and zero of the current sensors."""
DAMPED_S: Final = 0.02
"""Time constant of braking beside friction, without a limit of acceleration; the maker states none."""
_COMMAND: Final = {
    wire.COMMAND_POSITION: 0.0,
    wire.COMMAND_VELOCITY: 0.0,
    wire.MAXIMUM_TORQUE: math.nan,
    wire.WATCHDOG_TIMEOUT: 0.0,
    wire.VELOCITY_LIMIT: math.nan,
    wire.ACCELERATION_LIMIT: math.nan,
}
"""The registers of a command that are not written."""
_RESTING: Final = 1e-9  # turns/s
_LONGEST: Final = 64  # bytes of a frame
_SUPPLY_V: Final = 24.0  # of the simulated drive
UNKNOWN, READ_ONLY = 1, 2  # error numbers of a register
_INT8: Final = {wire.MODE: 1.0, wire.HOME_STATE: 1.0, wire.VOLTAGE: 0.5, wire.TEMPERATURE: 1.0, wire.FAULT_CODE: 1.0}
"""Registers that the simulated drive has as int8 too, and the value of a step; all others are floats alone."""


def answer(part: Part, register: Callable[[int], float | None]) -> tuple[bytes, bool]:
    """The reply to a query of registers, and whether all are known: else an error, and the rest is not read."""
    raw: list[float] = []
    for number in range(part.first, part.first + part.count):
        value = register(number)
        if value is None or (part.form != wire.FLOAT and number not in _INT8):
            return _error(wire.READ_ERROR, number, UNKNOWN), False
        raw.append(value if part.form == wire.FLOAT else round(min(max(value / _INT8[number], -127), 127)))
    reply = wire.head(wire.REPLY, part.form, part.first, len(raw)) + wire.values_in(part.form, raw)
    return reply if raw else b"", True


def _error(kind: int, number: int, code: int) -> bytes:
    return bytes((kind, *wire.varuint(number), code))


class MoteusDrive(MakersDrive):
    """It only replies. `settings` is its configuration as shipped since the firmware of March 2026. A command in
    position mode continues at its rate until its watchdog expires (0: `default_timeout_s`, nan: never). Then mode 11
    brakes by `timeout_mode` and is latched until "stopped". A fault removes the torque, so the carriage coasts, until
    "stopped" clears it. After a boot it knows its position at the output only with an `output_encoder`.
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
        """Settings made by "conf set" are lost."""
        super().boot(now)
        self.state, self.fault, self.home = STOPPED, 0, wire.OUTPUT if self.output_encoder else wire.ROTOR
        self.registers, self.prefix, self._prepared = dict(_COMMAND), 0, now
        self._stream = self._reply = b""
        self._commanded = False

    def configure(self, time_to_live_ms: int) -> None:
        self.prefix = wire.SESSION

    @property
    def watchdog_s(self) -> float:
        return self.registers[wire.WATCHDOG_TIMEOUT]

    @watchdog_s.setter
    def watchdog_s(self, seconds: float) -> None:
        self.registers[wire.WATCHDOG_TIMEOUT] = seconds

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
            self.power.aim(self.path.position / self.table.turns_per_m, dt)
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
        """Process the subframes in order, up to an unreadable one, and reply; the mode takes effect at the end."""
        self._reply, self._commanded = b"", False
        try:
            for part in wire.parts(data):
                if not self._done(part):
                    break
        except (IndexError, ValueError, OverflowError, struct.error):
            self.rejected += 1
        if self._commanded:
            self._obey(int(self.registers[wire.MODE]))
        if source & 0x80:
            number = self.prefix << 16 | self.node_id << 8 | source & 0x7F
            self.send(fd_frame(number, wire.padded(self._reply[:_LONGEST])))

    def _done(self, part: Part) -> bool:
        if part.kind == wire.STREAM_TO_SERVO:
            self._line(part.text)
        elif part.kind == wire.STREAM_POLL:
            some, self._stream = self._stream[: part.count], self._stream[part.count :]
            self._reply += bytes((wire.STREAM_FROM_SERVO, part.first, len(some))) + some
        elif part.kind == wire.WRITE:
            self._write(part)
        elif part.kind == wire.READ:
            reply, known = answer(part, self._register)
            self._reply += reply
            return known
        else:
            raise ValueError(f"subframe must be one for a drive; got {part.kind:#x}")
        return True

    def _write(self, part: Part) -> None:
        for number, value in enumerate(part.values, part.first):
            if number == wire.MODE and 0 <= value <= wire.BRAKE:
                self.registers, self._commanded = dict(_COMMAND) | {wire.MODE: value}, True
            elif number in _COMMAND and part.form == wire.FLOAT:
                self.registers[number] = value
            elif number == wire.SET_OUTPUT_EXACT and math.isfinite(value):
                self.power.output, self.home = value / self.table.turns_per_m, wire.OUTPUT
            elif not 0x20 <= number < 0x30:
                unknown = number == wire.MODE or self._register(number) is None
                self._reply += _error(wire.WRITE_ERROR, number, UNKNOWN if unknown else READ_ONLY)

    def _obey(self, mode: int) -> None:
        """Start the frame's command in `mode`; only "stopped" ends faults and timeouts."""
        if mode == STOPPED:
            self.fault = 0
            self._become(STOPPED)
        elif mode <= 4 or self.state in (FAULTED, TIMED_OUT):
            return
        elif mode != POSITION_MODE:
            self._become(mode)
        elif (
            self.settings["servo.bemf_feedforward"]
            and not self.settings["servo.bemf_feedforward_override"]
            and math.isnan(self._limit(wire.ACCELERATION_LIMIT, "servo.default_accel_limit"))
        ):
            self._fail(NO_ACCELERATION_LIMIT)
        else:
            self.good_at = self._now
            if self.state == STOPPED:
                self._prepared = self._now + PREPARES_S
                self._become(wire.ENABLING)
            elif self.state != wire.ENABLING:
                self._become(POSITION_MODE)
                self._aim()

    def _aim(self) -> None:
        speed = self._limit(wire.VELOCITY_LIMIT, "servo.default_velocity_limit")
        acceleration = self._limit(wire.ACCELERATION_LIMIT, "servo.default_accel_limit")
        if not (math.isnan(speed) and math.isnan(acceleration)):
            most = self.settings["servo.max_velocity"]
            speed = most if math.isnan(speed) else min(speed, most)
        position, rate = self.registers[wire.COMMAND_POSITION], self.registers[wire.COMMAND_VELOCITY]
        if not (abs(position) >= 1e6 or abs(rate) >= 1e6):
            self.path.command(position, rate, speed, acceleration)

    def _limit(self, number: int, setting: str) -> float:
        """A limit of the command: nan stands for the configuration's, a negative one for none (nan)."""
        value = self.settings[setting] if math.isnan(self.registers[number]) else self.registers[number]
        return math.nan if self.registers[number] < 0 else value

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
            wire.PATH_POSITION: self.path.position,
            wire.PATH_VELOCITY: self.path.rate,
        }
        return known[number] if number in known else self.registers.get(number)

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
