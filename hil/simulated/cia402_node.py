"""The CANopen side of a simulated CiA 402 drive: a network without threads, and its objects. Needs canopen."""

from __future__ import annotations

import contextlib
import math
from typing import Any, Final

import can
import canopen
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

from controller.limits import Limits
from hil.drives import cia402_protocol as p402
from hil.drives.cia402_protocol import Cia402Table
from hil.drives.cia402_setup import PROFILE, entries

KNOWN: Final = (p402.HOMING_MODE, p402.CYCLIC_SYNCHRONOUS_POSITION, p402.CYCLIC_SYNCHRONOUS_VELOCITY)
"""Modes of operation of the drive."""
MONITORED_OFF: Final = 0xFFFFFFFF  # following error window of a drive as shipped: not monitored
_READ_ONLY: Final = (0x1000, 0x1001, 0x603F, 0x6041, 0x6061, 0x6064, 0x606C, 0x6502)
_TYPES: Final = {1: datatypes.UNSIGNED8, 2: datatypes.UNSIGNED16, 4: datatypes.UNSIGNED32}
_SIGNED: Final = {1: datatypes.INTEGER8, 2: datatypes.INTEGER16, 4: datatypes.INTEGER32}
_NEGATIVE: Final = (0x607C, 0x607D, 0x6064, 0x606C, 0x607A, 0x60FF, 0x6060, 0x6061, 0x6098)  # objects that are signed


class PolledNetwork(canopen.Network):  # type: ignore[misc]
    """A network without threads: periodic frames are sent by `beat`, so that a dead drive is silent."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self._beats: list[_Beat] = []

    def send_periodic(self, can_id: int, data: Any, period: float, remote: bool = False) -> _Beat:
        self._beats.append(_Beat(self, can_id, bytes(data), period))
        return self._beats[-1]

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        with contextlib.suppress(can.CanError, OSError):
            super().send_message(can_id, data, remote)

    def beat(self, now: float) -> None:
        self._beats = [one for one in self._beats if one.alive]
        for one in self._beats:
            one.send(now)


class _Beat:
    def __init__(self, network: canopen.Network, identifier: int, data: bytes, period_s: float) -> None:
        self._network, self._identifier, self._data, self._period_s = network, identifier, data, period_s
        self._at, self.alive = -math.inf, True

    def send(self, now: float) -> None:
        if now - self._at >= self._period_s - 1e-4:
            self._at = now
            self._network.send_message(self._identifier, self._data)

    def update(self, data: Any) -> None:
        self._data = bytes(data)

    def stop(self) -> None:
        self.alive = False


def dictionary(table: Cia402Table, limits: Limits, tick_s: float) -> canopen.ObjectDictionary:
    """The drive's objects: its settings, with values at which it does not move, and its reports."""
    found = canopen.ObjectDictionary()
    objects = [(0x1000, 4, PROFILE | 2 << 16), (0x1001, 1, 0), (0x603F, 2, 0), (0x6040, 2, 0), (0x6041, 2, 0)]
    objects += [(0x6061, 1, 0), (0x6064, 4, 0), (0x606C, 4, 0), (0x607A, 4, 0), (0x607C, 4, 0), (0x60FF, 4, 0)]
    objects += [(0x6502, 4, sum(1 << (mode - 1) for mode in KNOWN)), (0x2000, 2, 0)]
    objects += [(0x6098, 1, 0)] * (not table.homing_method)
    objects += [(0x6065, 4, MONITORED_OFF), (0x6066, 2, 0)] * (not table.following_m)
    for index, size, value in objects:
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
    variable.data_type = (_SIGNED if signed and (sub != 0 or size == 4) else _TYPES)[size]
    variable.access_type = "ro" if index in _READ_ONLY else "rw"
    variable.default, variable.pdo_mappable = value, True
    return variable
