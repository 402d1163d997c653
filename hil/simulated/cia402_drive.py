"""A simulated CiA 402 drive on CANopen as the carriage. Needs canopen."""

import math
from typing import Any, Final

import can
import canopen

from hil.bus.wrapping import plain
from hil.drives import cia402_protocol as p402
from hil.drives.cia402_protocol import DEADLINE_ERROR, HEARTBEAT_ERROR, SENSOR_ERROR, TEMPERATURE_ERROR, Cia402Table
from hil.drives.cia402_setup import entries
from hil.nodes.frame_map import NO_FAULT
from hil.simulated.cia402_node import MONITORED_OFF, PolledNetwork, dictionary
from hil.simulated.drive_node import HOT_S
from hil.simulated.makers_drive import MakersDrive

UNHOMED, HOMING, HOMED, NOT_FOUND = range(4)
_HOMING_BITS: Final = {
    UNHOMED: p402.REACHED,
    HOMING: 0,
    HOMED: p402.REACHED | p402.ATTAINED,
    NOT_FOUND: p402.REACHED | p402.HOMING_ERROR,
}
"""Bits 13, 12 and 10 of the statusword: not started or interrupted, in progress, done, failed at rest."""
_INVALID_VALUE, _NOT_NOW = 0x06090030, 0x08000022  # abort codes of SDO


class Cia402Drive(MakersDrive):
    """RPDO 1 is applied with the next SYNC, which the TPDOs answer. Without SYNC the drive continues at its last rate:
    the worst that the profile permits. Faults: a late RPDO 1, a controller without heartbeat, over-temperature.

    Possible defects: it `stays` in its mode, `ignores` its targets and reports so, is `jammed`, or `homeless`.
    """

    LED = p402.OPERATION
    table: Cia402Table
    home_m = 0.0
    stays = ignores = jammed = homeless = False

    def boot(self, now: float) -> None:
        super().boot(now)
        self.network = PolledNetwork(self.bus)
        objects = dictionary(self.table, self.limits, self.tick_s)
        self.node = self.network.create_node(canopen.LocalNode(self.table.node_id, objects))
        self.node.add_write_callback(self._written)
        self.state, self.error, self.mode, self.homing = p402.NOT_READY, 0, 0, UNHOMED
        self._hot_since, self._word, self._mapped = math.inf, 0, False
        self._demand_m, self._rate_m_s, self._taken_at = math.nan, 0.0, now
        self._near_at, self._limited, self._heard_at = now, False, -math.inf
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"

    def configure(self, time_to_live_ms: int) -> None:
        for entry in entries(self.table, self.limits, self.tick_s, time_to_live_ms):
            self.node.set_data(entry.index, entry.sub, entry.data)
        self.node.nmt.state = "OPERATIONAL"

    def _stands(self) -> tuple[int, int]:
        return p402.shown(self._statusword()), p402.fault_of(self.error) if self.error else NO_FAULT

    def _hear(self, message: can.Message) -> None:
        if plain(message) and self.node_id == self.table.node_id:
            self.network.notify(message.arbitration_id, bytearray(message.data), message.timestamp)

    def _run(self) -> None:
        if self.node.nmt.state == "OPERATIONAL" and not self._mapped:
            self._map()
        before = self._word
        if not self._mapped:
            self._word = self._held(0x6040)
        self._go(self._word, before)
        if not self._mapped:
            if self.led and self.mode == p402.HOMING_MODE:
                self._home(begins=bool(self._word & ~before & p402.START_HOMING))
            counts = self.table.counts_per_m
            self.node.sdo[0x6064].raw = round((self.power.output - self.zero_m) * counts)
            self.node.sdo[0x606C].raw = round(self.power.rate * counts)
        self.node.sdo[0x6041].raw, self.node.sdo[0x603F].raw = self._statusword(), self.error
        self.network.beat(self._now)

    def _held(self, index: int, sub: int = 0) -> int:
        return int((self.node.sdo[index][sub] if sub else self.node.sdo[index]).raw)

    def output(self, dt: float, sensed: float) -> float:
        share = 0.0 if not self.led else 0.5 if self._warm else 1.0
        turns = self._rate_m_s and not (self.ignores or self.jammed)
        if share and turns and self._now - self._taken_at > self.tick_s - 0.5 * dt:
            self.power.aim(self.power.output + self._rate_m_s * dt, dt)
        return self.power.step(dt, share, sensed)

    @property
    def _warm(self) -> bool:
        return self.temperature_C > self.limits.derate_C

    def _statusword(self) -> int:
        word = p402.statusword_of(self.state, warning=self._warm)
        word |= p402.VOLTAGE if p402.READY_TO_SWITCH_ON <= self.state < p402.FAULTED else 0
        if self.mode == p402.HOMING_MODE:
            return word | _HOMING_BITS[self.homing]
        if not self._mapped:
            return word
        word |= p402.REMOTE | (p402.LIMITED if self._limited else 0)
        if not self.led or math.isnan(self._demand_m):
            return word
        late = self._now - self._near_at > 1e-3 * self._held(0x6066)
        deviates = late and self.mode != p402.CYCLIC_SYNCHRONOUS_VELOCITY
        return word | (0 if self.ignores else p402.FOLLOWS) | (p402.DEVIATES if deviates else 0)

    def _written(self, *, index: int, subindex: int, od: Any, data: bytes) -> None:
        if index == 0x6060:
            mode = int.from_bytes(data, "little", signed=True)
            if not (mode > 0 and self._held(0x6502) & 1 << (mode - 1)):
                raise canopen.SdoAbortedError(_INVALID_VALUE)
            if not self.stays or not self.mode:
                self.mode = mode
                self.node.sdo[0x6061].raw = mode
        elif subindex and index & 0xFE00 in (0x1600, 0x1A00) and not int(self.node.sdo[index - 0x200][1].raw) >> 31:
            raise canopen.SdoAbortedError(_NOT_NOW)

    def _home(self, *, begins: bool) -> None:
        """Home from the rising to the falling edge of bit 4: in place by methods 35 and 37, else at `home_m`."""
        if begins:
            self.homing = HOMING
        if self.homing != HOMING:
            return
        if not self._word & p402.START_HOMING or self.homeless:
            self.homing = NOT_FOUND if self.homeless else UNHOMED
            return
        moves = self._held(0x6098) not in p402.HOMES_HERE
        left = self.home_m - self.power.output if moves else 0.0
        step = 1e-3 * self._held(0x6099, 1) / self.table.counts_per_m
        self.power.aim(self.power.output + min(max(left, -step), step), 1e-3)
        if abs(left) <= step:
            self.zero_m, self.homing = self.power.output + left, HOMED

    def _map(self) -> None:
        self._mapped = True
        for pdo in (self.node.rpdo[1], self.node.tpdo[1], self.node.tpdo[2]):
            pdo.read()
        self.node.rpdo[1].add_callback(self._commanded)
        braking, window = self._held(0x6085), self._held(0x6065)
        self.power.braking_m_s2 = braking / self.table.counts_per_m
        self._window_m = math.inf if window == MONITORED_OFF else window / self.table.counts_per_m
        self.network.subscribe(self._held(0x1005), self._synchronised)
        self.network.subscribe(0x700 + (self._held(0x1016, 1) >> 16), self._heard)

    def _commanded(self, command: Any) -> None:
        self.good_at = command.timestamp

    def _heard(self, _: int, __: Any, stamp: float) -> None:
        self._heard_at = stamp

    def _synchronised(self, *_: Any) -> None:
        if math.isfinite(self.good_at):
            before, self._word = self._word, int(self.node.rpdo[1][0x6040].raw)
            self._go(self._word, before)
            if self.led:
                self._follow()
        first, second, counts = self.node.tpdo[1], self.node.tpdo[2], self.table.counts_per_m
        first[0x6041].raw, first[0x6064].raw = self._statusword(), round(self.shown_m * counts)
        second[0x606C].raw, second[0x603F].raw = round(self.power.rate * counts), self.error
        first.transmit()
        second.transmit()

    def _follow(self) -> None:
        """Apply the target, a position or a speed for a tick, within the drive's own limits."""
        counts, before = self.table.counts_per_m, self._demand_m
        if math.isnan(before) or abs(before - self.power.output) <= self._window_m:
            self._near_at = self._now
        most = self._held(0x607F) / counts * self.tick_s
        least, farthest = (self.zero_m + self._held(0x607D, side) / counts for side in (1, 2))
        here = self.power.output if math.isnan(before) else before
        if self.mode == p402.CYCLIC_SYNCHRONOUS_VELOCITY:
            here = self.power.output
            wanted = here + self.node.rpdo[1][0x60FF].raw / counts * self.tick_s
        else:
            wanted = self.zero_m + self.node.rpdo[1][0x607A].raw / counts
        self._demand_m = min(max(wanted, here - most, least), here + most, farthest)
        self._limited = abs(self._demand_m - wanted) > 1.5 / counts
        self._rate_m_s, self._taken_at = (self._demand_m - here) / self.tick_s, self._now
        if not (self.ignores or self.jammed):
            self.power.aim(self._demand_m, self.tick_s)

    def _go(self, word: int, before: int) -> None:
        cause, state = self._cause(), self.state
        self.state = p402.next_state(state, word, before, cause=bool(cause), at_rest=self.power.at_rest)
        if self.led and not self.mode:
            self.state = p402.SWITCHED_ON
        if not self.led:
            self._demand_m, self._rate_m_s, self._limited = math.nan, 0.0, False
        if self.state == p402.REACTING and state != p402.REACTING:
            self.error = cause
            self.node.emcy.send(cause, 1)
        elif self.state == p402.DISABLED and self.error:
            self.error = 0
            self.node.emcy.reset()
        self._since = self._now if self.state != state else self._since

    def _cause(self) -> int:
        self._hot_since = min(self._hot_since, self._now) if self.too_hot else math.inf
        if self._now - self._hot_since >= HOT_S:
            return TEMPERATURE_ERROR
        if self.broken:
            return SENSOR_ERROR
        if not self._mapped:
            return 0
        if self.led and self._now - self.good_at > 1e-3 * self._held(0x1400, 5):
            return DEADLINE_ERROR
        late = self._now - self._heard_at > 1e-3 * (self._held(0x1016, 1) & 0xFFFF)
        return HEARTBEAT_ERROR if late and self.state in (p402.SWITCHED_ON, p402.OPERATION) else 0
