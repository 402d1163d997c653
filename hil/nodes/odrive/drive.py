"""A carriage as an ODrive, simulated after the maker's description of CANSimple in firmware 0.6: what
`hil.nodes.odrive.actuator` sets up and leads, written apart from it.
"""

import math
import struct
from typing import Final

import can

from hil.nodes.drive.makers import MakersDrive
from hil.nodes.drive.node import MOST
from hil.nodes.drive.state_machine import NO_FAULT, Stage
from hil.nodes.frame_map import BOOT, ENABLED, FAULT, STANDBY, plain
from hil.nodes.listening import waiting
from hil.nodes.odrive import protocol as wire
from hil.nodes.odrive.table import OdriveTable

ENABLE_WATCHDOG, WATCHDOG_TIMEOUT = 417, 418
"""Endpoint ids of this simulated firmware where the table states none."""
FIRMWARE: Final = (0, 6, 11)  # that the simulated drive has
BOOT_S: Final = 0.05  # of the simulated drive
HEARTBEAT_EVERY, ESTIMATES_EVERY = 10, 2
"""In runs of the firmware of 1 ms."""
UNDEFINED, AXIS_IDLE, CLOSED_LOOP_CONTROL = 0, 1, 8  # axis states
# bits of ODrive.Error
INITIALIZING, MISSING_ESTIMATE, INVERTER_OVER_TEMP, WATCHDOG, ESTOP = 0x1, 0x8, 0x4000, 0x1000000, 0x2000000
_LENGTHS: Final = {0x04: 4, 0x07: 4, 0x0B: 8, 0x0C: 8, 0x0F: 8, 0x19: 4}
"""Bytes that the signals of a command take; the frame may be longer."""
POS_GAIN: Final = 20.0
"""axis0.controller.config.pos_gain as shipped, in 1/s."""


class OdriveDrive(MakersDrive):
    """It has no SYNC: a position acts at once, its reports leave in its own cycle. Its speed is `pos_gain` times what
    is left to the position, plus Vel_FF, so that the last command drives it on until the watchdog ends it. A command
    feeds the watchdog, which counts in closed loop control alone and may be off, as the maker ships it (`watchdog_on`).
    An error disarms: the axis is idle, the carriage coasts. An error whose cause is gone vanishes by itself,
    an e-stop stays; the reason of the disarming stays until Clear_Errors or the next arming. What became of the state
    that was asked for last is in each heartbeat.

    What it may do wrong: not be `calibrated`, or not take the commands `deaf_to`.
    """

    table: OdriveTable
    watchdog_on = calibrated = True
    watchdog_s = math.nan
    deaf_to = frozenset[int]()

    def boot(self, now: float) -> None:
        """Begin anew, as after a loss of supply; what it has saved stays."""
        self.power.braking_m_s2 = self.table.coast_m_s2
        self.watchdog_s = self.table.watchdog_s if math.isnan(self.watchdog_s) else self.watchdog_s
        self.axis, self.errors, self.disarmed_by, self.result = UNDEFINED, INITIALIZING, 0, wire.SUCCESS
        self.modes, self.vel_limit, self.current_A = (wire.POSITION_CONTROL, wire.PASSTHROUGH), 10.0, 10.0
        self.zero_m, self._stopped = 0.0, False
        self._target_m, self._ahead_m_s = self.power.output, 0.0
        self._now = self._since = self._began = now
        self._runs = 0
        self.fed_at = self.good_at = -math.inf

    @property
    def led(self) -> bool:
        """Whether it is in closed loop control."""
        return self.axis == CLOSED_LOOP_CONTROL

    @property
    def stage(self) -> Stage:
        """State and fault in the catalogue's numbers."""
        told = (self.errors & ~INITIALIZING) | self.disarmed_by
        idle = FAULT if told else STANDBY if self.axis == AXIS_IDLE else BOOT
        state = ENABLED if self.led else idle
        return Stage(state, self._since, wire.code_of(told) if told else NO_FAULT)

    def listen(self, now: float, slots: int) -> None:
        """One run of the firmware: take frames in, judge, report."""
        self._now = now
        if self.axis == UNDEFINED and now - self._began >= BOOT_S:
            self._become(AXIS_IDLE)
        for message in waiting(self.bus, MOST):
            if plain(message) and message.arbitration_id >> 5 in (self.node_id, wire.BROADCAST):
                self._take(message.arbitration_id & 0x1F, bytes(message.data))
        self._judge()
        self._runs += 1
        if now - self._began < 0.5 * BOOT_S:
            return
        if self._runs % HEARTBEAT_EVERY == 0:
            self._say(0x01, struct.pack("<IBBBB", self.errors, self.axis, self.result, 0, 0))
        if self._runs % ESTIMATES_EVERY == 0:
            scale = math.nan if self.broken else self.table.turns_per_m
            self._say(0x09, struct.pack("<ff", self.shown_m * scale, self.power.rate * scale))

    def output(self, dt: float, sensed: float) -> float:
        """The plant's command for the next `dt` s."""
        if self.led:
            here = self.power.output
            self.power.aim(here + (POS_GAIN * (self._target_m - here) + self._ahead_m_s) * dt, dt)
        return self.power.step(dt, float(self.led), sensed)

    def _judge(self) -> None:
        """What is wrong at this moment; it disarms an armed axis."""
        wrong = (INITIALIZING if self.axis == UNDEFINED else 0) | (ESTOP if self._stopped else 0)
        wrong |= MISSING_ESTIMATE if self.broken else 0
        wrong |= INVERTER_OVER_TEMP if self.temperature_C > self.limits.temperature_C else 0
        if self.led and self.watchdog_on and self._now - self.fed_at > self.watchdog_s:
            wrong |= WATCHDOG
        self.errors = wrong
        if self.led and wrong:
            self.disarmed_by, self.result = wrong, wire.DISARMED
            self._become(AXIS_IDLE)

    def _take(self, command: int, data: bytes) -> None:
        """A frame for this node; one that is shorter than its signals is refused."""
        if len(data) < _LENGTHS.get(command, 0):
            self.rejected += 1
        elif command in self.deaf_to:
            return
        elif command == 0x00:
            self._say(0x00, bytes((2, 4, 4, 58, *FIRMWARE, 0)))
        elif command == 0x02:
            self._stopped = True
            self.errors |= ESTOP
            self.disarmed_by |= ESTOP
            self._become(AXIS_IDLE)
        elif command == 0x03 and not data:
            self._say(0x03, struct.pack("<II", self.errors & ~INITIALIZING, self.disarmed_by))
        elif command == 0x04:
            self._read(*struct.unpack_from("<BH", data))
        elif command == 0x07:
            self._request(struct.unpack_from("<I", data)[0])
        elif command == 0x18:
            self.disarmed_by, self._stopped = 0, False
        else:
            self._set(command, data)

    def _set(self, command: int, data: bytes) -> None:
        """Modes, setpoint, limits and zero."""
        scale = self.table.turns_per_m
        if command == 0x0B:
            self.modes = data[0], data[4]
        elif command == 0x0C:
            self.fed_at = self.good_at = self._now
            turns, ahead, _ = struct.unpack_from("<fhh", data)
            if self.modes == (wire.POSITION_CONTROL, wire.PASSTHROUGH) and math.isfinite(turns):
                self._target_m, self._ahead_m_s = self.zero_m + turns / scale, ahead / wire.VEL_FF_SCALE / scale
        elif command == 0x0F:
            self.vel_limit, self.current_A = (abs(limit) for limit in struct.unpack_from("<ff", data))
            self.power.speed_m_s = min(self.vel_limit / abs(scale), self.limits.carriage_speed_m_s)
        elif command == 0x19:
            self.zero_m = self.power.output - struct.unpack_from("<f", data)[0] / scale

    def _request(self, wanted: int) -> None:
        """Set_Axis_State: what cannot be is told as a result."""
        self.fed_at = self._now
        if wanted == AXIS_IDLE:
            self._become(AXIS_IDLE)
        elif wanted not in wire.AXIS_STATES or wanted == UNDEFINED:
            self.result = wire.INVALID_STATE
        elif wanted != self.axis:
            self._begin(wanted)

    def _begin(self, wanted: int) -> None:
        """A state in which the motor has a current."""
        self.result = wire.DISARMED if self.errors else wire.SUCCESS
        if wanted == CLOSED_LOOP_CONTROL and not self.calibrated:
            self.result = wire.NOT_CALIBRATED
        if self.axis != AXIS_IDLE or self.result != wire.SUCCESS:
            return
        self.disarmed_by = 0
        self.result = wire.SUCCESS if wanted == CLOSED_LOOP_CONTROL else wire.BUSY
        self._target_m, self._ahead_m_s = self.power.output, 0.0
        self._become(wanted)

    def _read(self, opcode: int, endpoint: int) -> None:
        """RxSdo: only reading is simulated."""
        held = {
            "axis0.controller.config.control_mode": struct.pack("<B", self.modes[0]),
            "axis0.controller.config.input_mode": struct.pack("<B", self.modes[1]),
            "axis0.controller.config.vel_limit": struct.pack("<f", self.vel_limit),
            "axis0.config.motor.current_soft_max": struct.pack("<f", self.current_A),
            "axis0.config.can.input_vel_scale": struct.pack("<I", wire.VEL_FF_SCALE),
            "axis0.controller.config.circular_setpoints": struct.pack("<?", False),
        }
        known = {
            self.table.enable_watchdog_endpoint or ENABLE_WATCHDOG: struct.pack("<?", self.watchdog_on),
            self.table.watchdog_timeout_endpoint or WATCHDOG_TIMEOUT: struct.pack("<f", self.watchdog_s),
            **{number: held[path] for path, number in self.table.endpoints},
        }
        if opcode == 0 and endpoint in known:
            self._say(0x05, struct.pack("<BHB", 0, endpoint, 0) + known[endpoint])

    def _become(self, axis: int) -> None:
        if axis != self.axis:
            self.axis, self._since = axis, self._now

    def _say(self, command: int, data: bytes) -> None:
        identifier = self.node_id << 5 | command
        self.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data, is_rx=False))
