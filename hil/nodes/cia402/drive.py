"""A carriage as a CiA 402 drive on CANopen, simulated: what `hil.nodes.cia402.setup` sets up and `Cia402Bus` leads.
Needs canopen.
"""

import math
from typing import Any, Final

import canopen

from hil.nodes.cia402 import states as p402
from hil.nodes.cia402.node import MONITORED_OFF, PolledNetwork, dictionary
from hil.nodes.cia402.setup import entries
from hil.nodes.cia402.states import Cia402Table
from hil.nodes.drive.makers import MakersDrive
from hil.nodes.drive.node import HOT_S, MOST
from hil.nodes.drive.state_machine import NO_FAULT, Stage
from hil.nodes.frame_map import plain
from hil.nodes.listening import waiting

# emergency codes of CiA 301 and 402
DEADLINE_ERROR, HEARTBEAT_ERROR, TEMPERATURE_ERROR, SENSOR_ERROR = 0x8250, 0x8130, 0x4310, 0x7300
UNHOMED, HOMING, HOMED, NOT_FOUND = range(4)
_HOMING_BITS: Final = {
    UNHOMED: p402.REACHED,
    HOMING: 0,
    HOMED: p402.REACHED | p402.ATTAINED,
    NOT_FOUND: p402.REACHED | p402.HOMING_ERROR,
}
"""Bits 13, 12 and 10 of the statusword: not started or interrupted, on the way, done, failed at rest."""
_START_HOMING: Final = 1 << 4  # bit of the controlword, CiA 402
_INVALID_VALUE, _NOT_NOW = 0x06090030, 0x08000022
"""Abort codes of SDO."""


class Cia402Drive(MakersDrive):
    """What RPDO 1 holds counts from the next SYNC, which the TPDOs answer; where none comes it goes on at its last
    rate: the worst of what the profile leaves open for places, and what it means for speeds. RPDO 1 later than its
    event timer, a controller without heartbeat and too high a temperature are faults: brake, then latched. A fault
    reset disables, no more. It takes a mode that 0x6502 names and shows it at 0x6061, homes from the rising edge of bit
    4 on, and sets bits 10 to 13 of its statusword as the mode wants them.

    What it may do wrong: it `stays` in its mode whatever is asked for, `ignores` its targets and says so, is `jammed`,
    or does not find its home (`homeless`).
    """

    table: Cia402Table
    home_m = 0.0
    stays = ignores = jammed = homeless = False

    def boot(self, now: float) -> None:
        """Begin anew, as after a loss of supply: nothing is set up."""
        self.network = PolledNetwork(self.bus)
        self.node = self.network.create_node(
            canopen.LocalNode(self.table.node_id, dictionary(self.table, self.limits, self.tick_s))
        )
        self.mode = 0
        self.node.add_write_callback(self._written)
        self.state, self.error = p402.NOT_READY, 0
        self._now = self._since = now
        self._hot_since, self._word, self._mapped = math.inf, 0, False
        self.zero_m, self.homing = 0.0, UNHOMED
        self._demand_m, self._rate_m_s, self._taken_at = math.nan, 0.0, now
        self._near_at, self._limited = now, False
        self.good_at = self._heard_at = -math.inf
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"

    def configure(self, time_to_live_ms: int) -> None:
        """Set it up in its own process, as `hil.nodes.cia402.setup` would over the bus."""
        for entry in entries(self.table, self.limits, self.tick_s, time_to_live_ms):
            self.node.set_data(entry.index, entry.sub, entry.data)
        self.node.nmt.state = "OPERATIONAL"

    @property
    def led(self) -> bool:
        """Whether it is in operation."""
        return self.state == p402.OPERATION

    @property
    def stage(self) -> Stage:
        """State and fault in the catalogue's numbers."""
        return Stage(p402.shown(self._statusword()), self._since, p402.fault_of(self.error) if self.error else NO_FAULT)

    def listen(self, now: float, slots: int) -> None:
        """One run of the firmware: take frames in, judge, go on; reports leave with each SYNC."""
        self._now = now
        for message in waiting(self.bus, MOST):
            if plain(message) and self.node_id == self.table.node_id:
                self.network.notify(message.arbitration_id, bytearray(message.data), message.timestamp)
        if self.node.nmt.state == "OPERATIONAL" and not self._mapped:
            self._map()
        before = self._word
        if not self._mapped:
            self._word = int(self.node.sdo[0x6040].raw)
        self._go(self._word, before)
        if not self._mapped:
            if self.state == p402.OPERATION and self.mode == p402.HOMING_MODE:
                self._home(begins=bool(self._word & ~before & _START_HOMING))
            counts = self.table.counts_per_m
            self.node.sdo[0x6064].raw = round((self.power.output - self.zero_m) * counts)
            self.node.sdo[0x606C].raw = round(self.power.rate * counts)
        self.node.sdo[0x6041].raw, self.node.sdo[0x603F].raw = self._statusword(), self.error
        self.network.beat(now)

    def output(self, dt: float, sensed: float) -> float:
        """The plant's command for the next `dt` s."""
        share = 0.0 if self.state != p402.OPERATION else 0.5 if self._warm else 1.0
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
        if self.state != p402.OPERATION or math.isnan(self._demand_m):
            return word
        late = self._now - self._near_at > 1e-3 * int(self.node.sdo[0x6066].raw)
        deviates = late and self.mode != p402.CYCLIC_SYNCHRONOUS_VELOCITY
        return word | (0 if self.ignores else p402.FOLLOWS) | (p402.DEVIATES if deviates else 0)

    def _written(self, *, index: int, subindex: int, od: Any, data: bytes) -> None:
        """What an SDO must not write; and a mode that is taken."""
        if index == 0x6060:
            mode = int.from_bytes(data, "little", signed=True)
            if not (mode > 0 and int(self.node.sdo[0x6502].raw) & 1 << (mode - 1)):
                raise canopen.SdoAbortedError(_INVALID_VALUE)
            if not self.stays or not self.mode:
                self.mode = mode
                self.node.sdo[0x6061].raw = mode
        elif subindex and index & 0xFE00 in (0x1600, 0x1A00) and not int(self.node.sdo[index - 0x200][1].raw) >> 31:
            raise canopen.SdoAbortedError(_NOT_NOW)

    def _home(self, *, begins: bool) -> None:
        """From the rising edge of bit 4 until it falls: method 35 and 37 take the present place as zero, every other
        one moves to `home_m`.
        """
        if begins:
            self.homing = HOMING
        if self.homing != HOMING:
            return
        if not self._word & _START_HOMING or self.homeless:
            self.homing = NOT_FOUND if self.homeless else UNHOMED
            return
        moves = self.node.sdo[0x6098].raw not in (35, 37)
        left = self.home_m - self.power.output if moves else 0.0
        step = 1e-3 * int(self.node.sdo[0x6099][1].raw) / self.table.counts_per_m
        self.power.aim(self.power.output + min(max(left, -step), step), 1e-3)
        if abs(left) <= step:
            self.zero_m, self.homing = self.power.output + left, HOMED

    def _map(self) -> None:
        """Take the process data as it was set up."""
        self._mapped = True
        for place in (self.node.rpdo[1], self.node.tpdo[1], self.node.tpdo[2]):
            place.read()
        self.node.rpdo[1].add_callback(self._told)
        braking, window = int(self.node.sdo[0x6085].raw), int(self.node.sdo[0x6065].raw)
        self.power.braking_m_s2 = braking / self.table.counts_per_m
        self._window_m = math.inf if window == MONITORED_OFF else window / self.table.counts_per_m
        self.network.subscribe(int(self.node.sdo[0x1005].raw), self._synchronised)
        self.network.subscribe(0x700 + (int(self.node.sdo[0x1016][1].raw) >> 16), self._heard)

    def _told(self, command: Any) -> None:
        self.good_at = command.timestamp

    def _heard(self, _: int, __: Any, stamp: float) -> None:
        self._heard_at = stamp

    def _synchronised(self, *_: Any) -> None:
        """SYNC: the newest command is taken over, then the reports go out."""
        if math.isfinite(self.good_at):
            before, self._word = self._word, int(self.node.rpdo[1][0x6040].raw)
            self._go(self._word, before)
            if self.state == p402.OPERATION:
                self._follow()
        first, second, counts = self.node.tpdo[1], self.node.tpdo[2], self.table.counts_per_m
        first[0x6041].raw, first[0x6064].raw = self._statusword(), round(self.shown_m * counts)
        second[0x606C].raw, second[0x603F].raw = round(self.power.rate * counts), self.error
        first.transmit()
        second.transmit()

    def _follow(self) -> None:
        """Take the target over: a place, or a speed for a tick, within the drive's own limits."""
        counts, before = self.table.counts_per_m, self._demand_m
        if math.isnan(before) or abs(before - self.power.output) <= self._window_m:
            self._near_at = self._now
        most = int(self.node.sdo[0x607F].raw) / counts * self.tick_s
        least, farthest = (self.zero_m + int(self.node.sdo[0x607D][side].raw) / counts for side in (1, 2))
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
        """One step of the state machine."""
        cause, state = self._cause(), self.state
        self.state = p402.next_state(state, word, before, cause=bool(cause), at_rest=self.power.at_rest)
        if self.state == p402.OPERATION and not self.mode:
            self.state = p402.SWITCHED_ON
        if self.state != p402.OPERATION:
            self._demand_m, self._rate_m_s, self._limited = math.nan, 0.0, False
        if self.state == p402.REACTING and state != p402.REACTING:
            self.error = cause
            self.node.emcy.send(cause, 1)
        elif self.state == p402.DISABLED and self.error:
            self.error = 0
            self.node.emcy.reset()
        self._since = self._now if self.state != state else self._since

    def _cause(self) -> int:
        """The error code of what is wrong at this moment."""
        self._hot_since = (
            min(self._hot_since, self._now) if self.temperature_C > self.limits.temperature_C else math.inf
        )
        if self._now - self._hot_since >= HOT_S:
            return TEMPERATURE_ERROR
        if self.broken:
            return SENSOR_ERROR
        if (
            self.state == p402.OPERATION
            and self._mapped
            and self._now - self.good_at > 1e-3 * int(self.node.sdo[0x1400][5].raw)
        ):
            return DEADLINE_ERROR
        late = (
            self._now - self._heard_at > 1e-3 * (int(self.node.sdo[0x1016][1].raw) & 0xFFFF) if self._mapped else False
        )
        return HEARTBEAT_ERROR if late and self.state in (p402.SWITCHED_ON, p402.OPERATION) else 0
