"""A simulated ODrive as the carriage, after the maker's description of CANSimple in firmware 0.6."""

import math
import struct
from typing import Final

import can

from hil.bus.wrapping import plain
from hil.drives import odrive_protocol as wire
from hil.drives.odrive_protocol import CLOSED_LOOP, IDLE, INITIALIZING, UNDEFINED, Command, OdriveTable
from hil.nodes.frame_map import BOOT, ENABLED, FAULT, NO_FAULT, STANDBY
from hil.simulated.makers_drive import MakersDrive

ENABLE_WATCHDOG, WATCHDOG_TIMEOUT = 417, 418  # endpoint ids of the simulated firmware, unless the table states others
FIRMWARE: Final = (0, 6, 11)  # of the simulated drive
BOOT_S: Final = 0.05  # of the simulated drive
HEARTBEAT_EVERY, ESTIMATES_EVERY = 10, 2  # in runs of the firmware, 1 ms each
MISSING_ESTIMATE, INVERTER_OVER_TEMP, WATCHDOG, ESTOP = 0x8, 0x4000, 0x1000000, 0x2000000  # bits of ODrive.Error
_TAKEN: Final = {
    one.number: one
    for one in (
        wire.RX_SDO,
        wire.SET_AXIS_STATE,
        wire.SET_CONTROLLER_MODE,
        wire.SET_INPUT_POS,
        wire.SET_LIMITS,
        wire.SET_ABSOLUTE_POSITION,
    )
}
"""Frames with signals that it receives."""
POS_GAIN: Final = 20.0  # axis0.controller.config.pos_gain as shipped, in 1/s


class OdriveDrive(MakersDrive):
    """It has no SYNC: a position acts at once, and its reports are sent in its own cycle. Its speed is `pos_gain` times
    the position error, plus Vel_FF; the last command acts until the watchdog expires, which may be off (`watchdog_on`).
    An error disarms, and the carriage coasts. An error vanishes with its cause, except an e-stop; the reason of
    disarming stays until Clear_Errors or the next arming. Possible defects: not `calibrated`, `deaf_to` commands.
    """

    LED = CLOSED_LOOP
    table: OdriveTable
    watchdog_on = calibrated = True
    watchdog_s = math.nan
    deaf_to = frozenset[int]()

    def boot(self, now: float) -> None:
        super().boot(now)
        self.power.braking_m_s2 = self.table.coast_m_s2
        self.watchdog_s = self.table.watchdog_s if math.isnan(self.watchdog_s) else self.watchdog_s
        self.state, self.errors, self.disarmed_by, self.result = UNDEFINED, INITIALIZING, 0, wire.SUCCESS
        self.modes, self.vel_limit, self.current_A = (wire.POSITION_CONTROL, wire.PASSTHROUGH), 10.0, 10.0
        self._stopped, self._runs, self.fed_at = False, 0, -math.inf
        self._target_m, self._ahead_m_s = self.power.output, 0.0

    def _stands(self) -> tuple[int, int]:
        errors = (self.errors & ~INITIALIZING) | self.disarmed_by
        idle = FAULT if errors else STANDBY if self.state == IDLE else BOOT
        return ENABLED if self.led else idle, wire.code_of(errors) if errors else NO_FAULT

    def listen(self, now: float, slots: int) -> None:
        self._now = now
        if self.state == UNDEFINED and now - self._began >= BOOT_S:
            self._become(IDLE)
        super().listen(now, slots)

    def _hear(self, message: can.Message) -> None:
        if plain(message) and message.arbitration_id >> 5 in (self.node_id, wire.BROADCAST):
            self._take(message.arbitration_id & 0x1F, bytes(message.data))

    def _run(self) -> None:
        self._judge()
        self._runs += 1
        if self._now - self._began < 0.5 * BOOT_S:
            return
        if self._runs % HEARTBEAT_EVERY == 0:
            self._say(wire.HEARTBEAT, self.errors, self.state, self.result, 0)
        if self._runs % ESTIMATES_EVERY == 0:
            scale = math.nan if self.broken else self.table.turns_per_m
            self._say(wire.GET_ENCODER_ESTIMATES, self.shown_m * scale, self.power.rate * scale)

    def output(self, dt: float, sensed: float) -> float:
        if self.led:
            here = self.power.output
            self.power.aim(here + (POS_GAIN * (self._target_m - here) + self._ahead_m_s) * dt, dt)
        return self.power.step(dt, float(self.led), sensed)

    def _judge(self) -> None:
        wrong = (INITIALIZING if self.state == UNDEFINED else 0) | (ESTOP if self._stopped else 0)
        wrong |= (MISSING_ESTIMATE if self.broken else 0) | (INVERTER_OVER_TEMP if self.too_hot else 0)
        if self.led and self.watchdog_on and self._now - self.fed_at > self.watchdog_s:
            wrong |= WATCHDOG
        self.errors = wrong
        if self.led and wrong:
            self.disarmed_by, self.result = wrong, wire.DISARMED
            self._become(IDLE)

    def _take(self, command: int, data: bytes) -> None:
        frame = _TAKEN.get(command)
        values = () if frame is None else frame.read(data)
        if values is None:
            self.rejected += 1
        elif command in self.deaf_to:
            return
        elif frame is not None:
            self._set(frame, *values)
        elif command == wire.GET_VERSION.number:
            self._say(wire.GET_VERSION, 2, 4, 4, 58, *FIRMWARE, 0)
        elif command == wire.ESTOP.number:
            self._stopped = True
            self.errors |= ESTOP
            self.disarmed_by |= ESTOP
            self._become(IDLE)
        elif command == wire.GET_ERROR.number and not data:
            self._say(wire.GET_ERROR, self.errors & ~INITIALIZING, self.disarmed_by)
        elif command == wire.CLEAR_ERRORS.number:
            self.disarmed_by, self._stopped = 0, False

    def _set(self, frame: Command, *values: float) -> None:
        scale = self.table.turns_per_m
        if frame is wire.RX_SDO:
            self._read(int(values[0]), int(values[1]))
        elif frame is wire.SET_AXIS_STATE:
            self._request(int(values[0]))
        elif frame is wire.SET_CONTROLLER_MODE:
            self.modes = int(values[0]), int(values[1])
        elif frame is wire.SET_LIMITS:
            self.vel_limit, self.current_A = values
        elif frame is wire.SET_ABSOLUTE_POSITION:
            self.zero_m = self.power.output - values[0] / scale
        else:
            self.fed_at = self.good_at = self._now
            if self.modes == (wire.POSITION_CONTROL, wire.PASSTHROUGH) and math.isfinite(values[0]):
                self._target_m, self._ahead_m_s = self.zero_m + values[0] / scale, values[1] / wire.VEL_FF_SCALE / scale

    def _request(self, wanted: int) -> None:
        self.fed_at = self._now
        if wanted == IDLE:
            self._become(IDLE)
        elif wanted not in wire.AXIS_STATES or wanted == UNDEFINED:
            self.result = wire.INVALID_STATE
        elif wanted != self.state:
            self._begin(wanted)

    def _begin(self, wanted: int) -> None:
        self.result = wire.DISARMED if self.errors else wire.SUCCESS
        if wanted == CLOSED_LOOP and not self.calibrated:
            self.result = wire.NOT_CALIBRATED
        if self.state != IDLE or self.result != wire.SUCCESS:
            return
        self.disarmed_by = 0
        self.result = wire.SUCCESS if wanted == CLOSED_LOOP else wire.BUSY
        self._target_m, self._ahead_m_s = self.power.output, 0.0
        self._become(wanted)

    def _read(self, opcode: int, endpoint: int) -> None:
        """RxSdo: only reading is simulated."""
        settings: dict[str, float] = {
            "axis0.controller.config.control_mode": self.modes[0],
            "axis0.controller.config.input_mode": self.modes[1],
            "axis0.controller.config.vel_limit": self.vel_limit,
            "axis0.config.motor.current_soft_max": self.current_A,
            "axis0.config.can.input_vel_scale": wire.VEL_FF_SCALE,
            "axis0.controller.config.circular_setpoints": False,
        }
        known = {
            self.table.enable_watchdog_endpoint or ENABLE_WATCHDOG: ("<?", self.watchdog_on),
            self.table.watchdog_timeout_endpoint or WATCHDOG_TIMEOUT: ("<f", self.watchdog_s),
            **{number: (wire.READ_BACK[path][0], settings[path]) for path, number in self.table.endpoints},
        }
        if opcode == 0 and endpoint in known:
            self._say(wire.TX_SDO, 0, endpoint, 0, more=struct.pack(*known[endpoint]))

    def _say(self, command: Command, *values: float, more: bytes = b"") -> None:
        self.send(command.to(self.node_id, *values, more=more))
