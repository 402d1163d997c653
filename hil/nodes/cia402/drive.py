"""A carriage as a CiA 402 drive on CANopen, simulated: what `hil.nodes.cia402.setup` sets up and `Cia402Bus` leads.
Needs canopen.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from typing import Any, Final

import can
import canopen
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

from controller.limits import Limits
from hil.nodes.cia402.setup import PROFILE, entries
from hil.nodes.cia402.states import (
    CYCLIC_SYNCHRONOUS_POSITION,
    CYCLIC_SYNCHRONOUS_VELOCITY,
    DISABLED,
    HOMING_MODE,
    NOT_READY,
    OPERATION,
    REACTING,
    SWITCHED_ON,
    Cia402Table,
    fault_of,
    next_state,
    shown,
    statusword_of,
)
from hil.nodes.drive.node import HOT_S
from hil.nodes.drive.power_stage import CarriagePower
from hil.nodes.drive.state_machine import NO_FAULT, Stage
from hil.nodes.frame_map import plain
from hil.nodes.listening import waiting

DEADLINE_ERROR, HEARTBEAT_ERROR, TEMPERATURE_ERROR, SENSOR_ERROR = 0x8250, 0x8130, 0x4310, 0x7300
_MOST: Final = 256
_LED: Final = (HOMING_MODE, CYCLIC_SYNCHRONOUS_POSITION, CYCLIC_SYNCHRONOUS_VELOCITY)
_AMBIENT_C: Final = 25.0
_TYPES: Final = {1: datatypes.UNSIGNED8, 2: datatypes.UNSIGNED16, 4: datatypes.UNSIGNED32}
_SIGNED: Final = {1: datatypes.INTEGER8, 2: datatypes.INTEGER16, 4: datatypes.INTEGER32}
_NEGATIVE: Final = (0x607D, 0x6064, 0x606C, 0x607A, 0x60FF, 0x6060, 0x6061, 0x6098)


class Cia402Drive:
    """Behaves as a `DriveNode` to the plant: `listen` once a slot, `output` for the plant's command.

    In cyclic synchronous position: what RPDO 1 holds counts from the next SYNC, which the TPDOs answer. RPDO 1 later
    than its event timer, a controller without heartbeat and too high a temperature are faults: brake, then latched. A
    fault reset disables, no more.
    """

    def __init__(
        self, bus: can.BusABC, table: Cia402Table, power: CarriagePower, limits: Limits, tick_s: float
    ) -> None:
        self.bus, self.table, self.power, self.limits, self.tick_s = bus, table, power, limits, tick_s
        self.heated_to_C, self.misread = -math.inf, None
        self.home_m = 0.0
        self.broken, self.node_id = False, table.node_id
        self.rejected = 0
        self.boot(0.0)

    misread: Callable[[float], float] | None

    def boot(self, now: float) -> None:
        """Begin anew, as after a loss of supply: nothing is set up."""
        self.network = _Polled(self.bus)
        self.node = self.network.create_node(
            canopen.LocalNode(self.table.node_id, _dictionary(self.table, self.limits, self.tick_s))
        )
        self.state, self.error, self.temperature_C = NOT_READY, 0, _AMBIENT_C
        self._now = self._since = now
        self._hot_since, self._word, self._mapped = math.inf, 0, False
        self.zero_m, self.homed = 0.0, False
        self.good_at = self._heard_at = -math.inf
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"

    def configure(self, time_to_live_ms: int) -> None:
        """Set it up in its own process, as `hil.nodes.cia402.setup` would over the bus."""
        for entry in entries(self.table, self.limits, self.tick_s, time_to_live_ms):
            self.node.set_data(entry.index, entry.sub, entry.data)
        self.node.nmt.state = "OPERATIONAL"

    @property
    def safe(self) -> bool:
        """Whether the drive follows no command and is at rest."""
        return self.state != OPERATION and self.power.at_rest

    @property
    def stage(self) -> Stage:
        """State and fault in the catalogue's numbers."""
        return Stage(shown(self._statusword()), self._since, fault_of(self.error) if self.error else NO_FAULT)

    def listen(self, now: float, slots: int) -> None:
        """One run of the firmware: take frames in, judge, go on; reports leave with each SYNC."""
        self._now = now
        for message in waiting(self.bus, _MOST):
            if plain(message) and self.node_id == self.table.node_id:
                self.network.notify(message.arbitration_id, bytearray(message.data), message.timestamp)
        if self.node.nmt.state == "OPERATIONAL" and not self._mapped:
            self._map()
        self.temperature_C = max(_AMBIENT_C, self.heated_to_C)
        before = self._word
        if not self._mapped:
            self._word = int(self.node.sdo[0x6040].raw)
        self._go(self._word, before)
        if not self._mapped and self.state == OPERATION and self.node.sdo[0x6060].raw == HOMING_MODE:
            self._home()
        self.node.sdo[0x6041].raw = self._statusword()
        self.network.beat(now)

    def output(self, dt: float, sensed: float) -> float:
        """The plant's command for the next `dt` s."""
        share = 0.0 if self.state != OPERATION else 0.5 if self._warm else 1.0
        return self.power.step(dt, share, sensed)

    @property
    def _warm(self) -> bool:
        return self.temperature_C > self.limits.derate_C

    def _statusword(self) -> int:
        return statusword_of(self.state, warning=self._warm) | (1 << 12 if self.homed and not self._mapped else 0)

    def _home(self) -> None:
        """Method 35 and 37 take the present place as zero; every other one moves to `home_m`."""
        moves = self.node.sdo[0x6098].raw not in (35, 37)
        left = self.home_m - self.power.output if moves else 0.0
        if self._word & 0x10 and not self.homed:
            step = 1e-3 * int(self.node.sdo[0x6099][1].raw) / self.table.counts_per_m
            self.power.aim(self.power.output + min(max(left, -step), step), 1e-3)
            if abs(left) <= step:
                self.zero_m, self.homed = self.power.output + left, True

    def _map(self) -> None:
        """Take the process data as it was set up."""
        self._mapped = True
        for place in (self.node.rpdo[1], self.node.tpdo[1], self.node.tpdo[2]):
            place.read()
        self.node.rpdo[1].add_callback(self._told)
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
            if self.state == OPERATION:
                self._follow()
        place, speed = self.power.output - self.zero_m, self.power.rate
        place = place if self.misread is None else self.misread(place)
        first, second = self.node.tpdo[1], self.node.tpdo[2]
        first[0x6041].raw, first[0x6064].raw = self._statusword(), round(place * self.table.counts_per_m)
        second[0x606C].raw, second[0x603F].raw = round(speed * self.table.counts_per_m), self.error
        first.transmit()
        second.transmit()

    def _follow(self) -> None:
        """Take the target over: a place, or a speed for a tick."""
        if self.node.sdo[0x6060].raw == CYCLIC_SYNCHRONOUS_VELOCITY:
            speed = self.node.rpdo[1][0x60FF].raw / self.table.counts_per_m
            self.power.aim(self.power.output + speed * self.tick_s, self.tick_s)
        else:
            self.power.aim(self.zero_m + self.node.rpdo[1][0x607A].raw / self.table.counts_per_m, self.tick_s)

    def _go(self, word: int, before: int) -> None:
        """One step of the state machine."""
        cause, state = self._cause(), self.state
        self.state = next_state(state, word, before, cause=bool(cause), at_rest=self.power.at_rest)
        if self.state == OPERATION and self.node.sdo[0x6060].raw not in _LED:
            self.state = SWITCHED_ON
        if self.state == REACTING and state != REACTING:
            self.error = cause
            self.node.emcy.send(cause, 1)
        elif self.state == DISABLED and self.error:
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
            self.state == OPERATION
            and self._mapped
            and self._now - self.good_at > 1e-3 * int(self.node.sdo[0x1400][5].raw)
        ):
            return DEADLINE_ERROR
        late = (
            self._now - self._heard_at > 1e-3 * (int(self.node.sdo[0x1016][1].raw) & 0xFFFF) if self._mapped else False
        )
        return HEARTBEAT_ERROR if late and self.state in (SWITCHED_ON, OPERATION) else 0


class _Polled(canopen.Network):  # type: ignore[misc]
    """A network without threads: what is periodic leaves when `beat` is called, so that a dead drive is silent."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self._beats: list[_Beat] = []

    def send_periodic(self, can_id: int, data: Any, period: float, remote: bool = False) -> _Beat:
        """Remember what is to be sent."""
        self._beats.append(_Beat(self, can_id, bytes(data), period))
        return self._beats[-1]

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        """Send a frame; a drive that is off the bus goes on without it."""
        with contextlib.suppress(can.CanError, OSError):
            super().send_message(can_id, data, remote)

    def beat(self, now: float) -> None:
        """Send what is due."""
        self._beats = [one for one in self._beats if one.alive]
        for one in self._beats:
            one.send(now)


class _Beat:
    """A periodic frame."""

    def __init__(self, network: canopen.Network, identifier: int, data: bytes, period_s: float) -> None:
        self._network, self._identifier, self._data, self._period_s = network, identifier, data, period_s
        self._at, self.alive = -math.inf, True

    def send(self, now: float) -> None:
        """Send it where it is due."""
        if now - self._at >= self._period_s - 1e-4:
            self._at = now
            self._network.send_message(self._identifier, self._data)

    def update(self, data: Any) -> None:
        """Other contents from now on."""
        self._data = bytes(data)

    def stop(self) -> None:
        """No more."""
        self.alive = False


def _dictionary(table: Cia402Table, limits: Limits, tick_s: float) -> canopen.ObjectDictionary:
    """The drive's objects: all that may be set, at the values that leave it still, and what it tells."""
    found = canopen.ObjectDictionary()
    tells = [(0x1000, 4, PROFILE | 2 << 16), (0x1001, 1, 0), (0x603F, 2, 0), (0x6040, 2, 0), (0x6041, 2, 0)]
    tells += [(0x6061, 1, 0), (0x6064, 4, 0), (0x606C, 4, 0), (0x607A, 4, 0), (0x60FF, 4, 0), (0x6502, 4, 1 << 7)]
    tells += [(0x6098, 1, 0)] * (not table.homing_method) + [(0x2000, 2, 0)]
    for index, size, value in tells:
        found.add_object(_variable(index, 0, size, value))
    for entry in entries(table, limits, tick_s, 1):
        many = entry.index in (0x1016, 0x607D, 0x6099, 0x60C2) or 0x1400 <= entry.index < 0x1B00
        if not many:
            found.add_object(_variable(entry.index, 0, entry.size, 0))
            continue
        if entry.index not in found:
            record = ODArray if 0x1600 <= entry.index < 0x1800 or entry.index >= 0x1A00 else ODRecord
            found.add_object(record(f"0x{entry.index:04X}", entry.index))
            found[entry.index].add_member(_variable(entry.index, 0, 1, 0))
        if entry.sub and entry.sub not in found[entry.index].subindices:
            found[entry.index].add_member(_variable(entry.index, entry.sub, entry.size, 0))
    return found


def _variable(index: int, sub: int, size: int, value: int) -> ODVariable:
    variable = ODVariable(f"0x{index:04X}:{sub:02X}", index, sub)
    signed = index in _NEGATIVE or (index, sub) == (0x60C2, 2)
    variable.data_type, variable.access_type = (
        (_SIGNED if (signed and sub != 0) or (signed and size == 4) else _TYPES)[size],
        "rw",
    )
    variable.default, variable.pdo_mappable = value, True
    return variable
