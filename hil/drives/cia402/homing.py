"""Lets a CiA 402 drive take a mode, and home itself, over SDO: neither is believed before the drive shows it."""

import math
import time
from typing import Any, Final

from hil.drives.cia402 import protocol as p402
from hil.drives.cia402.protocol import Cia402Table

_HERE_M: Final = 1e-4  # how far off its home offset such a drive may tell its place afterwards
_WORDS: Final = {
    p402.DISABLED: p402.SHUTDOWN,
    p402.READY_TO_SWITCH_ON: p402.SWITCH_ON,
    p402.SWITCHED_ON: p402.ENABLE_OPERATION,
    p402.OPERATION: p402.ENABLE_OPERATION | p402.START_HOMING,
}
_MODE_S, _ERROR_S = 0.5, 0.1
"""Within how long a drive must show a mode; and from when on after the start a homing error is of this homing."""


def word_of(node: Any, index: int, *, signed: bool = False) -> int:
    """The value of an object without subindex."""
    return int.from_bytes(node.sdo.upload(index, 0), "little", signed=signed)


def take_mode(node: Any, table: Cia402Table, mode: int) -> None:
    """Ask for a mode (0x6060) and wait until it is shown (0x6061). Raises ValueError."""
    node.sdo.download(0x6060, 0, mode.to_bytes(1, "little"))
    end = time.monotonic() + _MODE_S
    while (shown := word_of(node, 0x6061, signed=True)) != mode:
        if time.monotonic() > end:
            raise ValueError(_another_mode(table, mode, shown))
        time.sleep(0.005)


def _another_mode(table: Cia402Table, mode: int, shown: int) -> str:
    return f"{table.node} must take mode {p402.mode_words(mode)}; 0x6061 shows {p402.mode_words(shown)}"


def home(node: Any, network: Any, table: Cia402Table) -> None:
    """Let the drive home itself, under our heartbeat, and disable it again, whatever goes wrong. Raises ValueError."""
    take_mode(node, table, p402.HOMING_MODE)
    end, run = time.monotonic() + table.homing_s, _Homing(table)
    try:
        while True:
            network.send_message(0x700 + p402.MASTER_NODE, bytes((p402.OPERATIONAL,)))
            status = word_of(node, 0x6041)
            if run.done(node, status):
                break
            if time.monotonic() > end:
                left = "; bit 12 is from before it was started" if run.left_over(status) else ""
                raise ValueError(
                    f"{table.node} must be home within {table.homing_s:g} s; statusword 0x{status:04X}{left}"
                )
            word = _WORDS.get(p402.state_of(status), p402.DISABLE_VOLTAGE)
            node.sdo.download(0x6040, 0, word.to_bytes(2, "little"))
            if word & p402.START_HOMING:
                run.started_s = min(run.started_s, time.monotonic())
            time.sleep(0.005)
    finally:
        for word in (p402.HALT_QUICKLY, p402.DISABLE_VOLTAGE):
            node.sdo.download(0x6040, 0, word.to_bytes(2, "little"))
            time.sleep(0.05)


class _Homing:
    """What a statusword means on the way. Bit 12 of an earlier homing may still be set: it counts once it has been away
    since the start, or where the drive stands at its home offset and was to take that place.
    """

    def __init__(self, table: Cia402Table) -> None:
        self._table, self._away = table, False
        self.started_s = math.inf

    def left_over(self, status: int) -> bool:
        """Whether bit 12 has been set all the time."""
        return bool(status & p402.ATTAINED) and not self._away

    def done(self, node: Any, status: int) -> bool:
        """Whether it is home: in mode 6, in operation, attained since the start, at rest. Raises ValueError."""
        name, state = self._table.node, p402.state_of(status)
        if state in (p402.REACTING, p402.FAULTED):
            raise ValueError(f"{name} must home; got a fault, error code 0x{word_of(node, 0x603F):04X}")
        if state == p402.OPERATION and (mode := word_of(node, 0x6061, signed=True)) != p402.HOMING_MODE:
            raise ValueError(_another_mode(self._table, p402.HOMING_MODE, mode))
        if state != p402.OPERATION:
            return False
        self._away = self._away or not status & p402.ATTAINED
        since_s = time.monotonic() - self.started_s
        if status & p402.HOMING_ERROR and since_s > _ERROR_S:
            raise ValueError(f"{name} must home; got a homing error (bit 13 of statusword 0x{status:04X})")
        attained = status & p402.ATTAINED and status & p402.REACHED
        return since_s > 0 and bool(attained) and (self._away or self._here(node))

    def _here(self, node: Any) -> bool:
        """Whether the drive was to take its place as home, and tells its home offset (0x607C) as its place."""
        if self._table.homing_method not in p402.HOMES_HERE:
            return False
        try:
            offset = word_of(node, 0x607C, signed=True)
        except Exception:  # noqa: BLE001 - an object that a drive may do without; drivers raise whatever they like
            offset = 0
        return abs(word_of(node, 0x6064, signed=True) - offset) <= max(_HERE_M * self._table.counts_per_m, 1.0)
