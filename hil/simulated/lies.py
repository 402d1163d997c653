"""Faulty readings of a broken sensor, and of a localiser or a drive whose frames are valid but false."""

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from hil.simulated.faults import Fault
from plant.drives import TrueCoil, TrueDrive
from plant.sensing import Instrument, Reading

SWAY_S: Final = 8.0  # period
FASTEST_M_S: Final = 0.5  # of a carriage that jumps
_FOREIGN_S: Final = (11.0, 4.7, 2.9)  # periods of the sines of a foreign motion
_LATE: Final = ("late", "late_unsaid")


class Lie:
    """`fault` as a function of time and true value; changes count from the first value, or from `about`."""

    def __init__(self, fault: Fault, seed: int = 0, std: float = 0.0, about: float = math.nan) -> None:
        self.fault, self.first, self.last, self.about = fault, math.nan, math.nan, about
        self._rng, self._std = random.Random(seed), std
        self._phases = [self._rng.uniform(0.0, 2 * math.pi) for _ in _FOREIGN_S]

    def __call__(self, time_s: float, value: float) -> float:
        if math.isnan(self.first):
            self.first = self.last = value
            self.about = value if math.isnan(self.about) else self.about
        self.last = _MADE[self.fault.kind](self, max(time_s - self.fault.at_s, 0.0), value)
        return self.last

    @property
    def noise(self) -> float:
        return self._rng.gauss(0.0, self._std)

    def _drift(self, since_s: float, value: float) -> float:
        most = math.inf if math.isnan(self.fault.size_m) else self.fault.size_m
        return value + min(max(self.fault.amount * since_s, -most), most)

    def _foreign(self, since_s: float, value: float) -> float:
        waves = zip(_FOREIGN_S, self._phases, strict=True)
        change = sum(math.sin(2 * math.pi * since_s / period_s + p) - math.sin(p) for period_s, p in waves)
        return self.first + self.fault.amount * change / len(_FOREIGN_S) + self.noise


_MADE: Final[Mapping[str, Callable[[Lie, float, float], float]]] = {
    "stuck": lambda lie, since_s, value: lie.first,
    "biased": lambda lie, since_s, value: value + lie.fault.amount,
    "nan": lambda lie, since_s, value: math.nan,
    "drift": Lie._drift,
    "jumped": lambda lie, since_s, value: value + lie.fault.amount,
    "sway": lambda lie, since_s, value: value + lie.fault.amount * math.sin(2 * math.pi * since_s / SWAY_S),
    "flipped": lambda lie, since_s, value: -value,
    "turned": lambda lie, since_s, value: 2 * lie.about - value,
    "scaled": lambda lie, since_s, value: lie.about + lie.fault.amount * (value - lie.about),
    "held": lambda lie, since_s, value: lie.noise + (lie.first if math.isnan(lie.fault.value) else lie.fault.value),
    "swapped": lambda lie, since_s, value: value,
    "foreign": Lie._foreign,
    "noisy": lambda lie, since_s, value: value + math.sqrt(lie.fault.amount**2 - 1) * lie.noise,
    "coarse": lambda lie, since_s, value: round(value / lie.fault.amount) * lie.fault.amount,
    "sticks": lambda lie, since_s, value: value if abs(value - lie.last) >= lie.fault.amount else lie.last,
}
"""By kind: the false value, from the time in s since the fault began and the true value."""


class LyingLocaliser:
    """The readings of a localiser with `fault`, kept in `reported`. `position`: that of carriage or inner mass."""

    def __init__(self, fault: Fault, instrument: Instrument, seed: int, position: Callable[[], float]) -> None:
        self.reported: list[tuple[float, float]] = []
        self._fault, self._instrument, self._position = fault, instrument, position
        self._lie = Lie(fault, seed, instrument.std)
        self._kept: list[Reading] = []

    def __call__(self, now: float, readings: list[Reading]) -> list[Reading]:
        if self._fault.kind == "lost":
            return []
        made = self._late(now, readings) if self._fault.kind in _LATE else [self._false(r) for r in readings]
        self.reported += [(r.stamp_s, r.value) for r in made]
        return made

    def _false(self, reading: Reading) -> Reading:
        value = self._position() + self._lie.noise if self._fault.kind == "swapped" else reading.value
        return replace(reading, value=self._lie(reading.stamp_s, value))

    def _late(self, now: float, readings: list[Reading]) -> list[Reading]:
        kept = [*self._kept, *readings]
        due = [r for r in kept if now - r.stamp_s >= self._fault.amount - 1e-9]
        self._kept = kept[len(due) :]
        if self._fault.kind == "late":
            return due
        return [replace(r, stamp_s=now - self._instrument.latency_s) for r in due]


class LyingDrive:
    """A drive that moves as `fault` distorts its command, while its report follows the command."""

    def __init__(self, fault: Fault, drive: TrueDrive, at: float, current_A: float) -> None:
        """`at` is the plant's previous command."""
        self.current_A = current_A
        self._lie: Lie | None = Lie(fault, about=zero_of(drive))
        self._drive, self._at, self._shift = drive, at, 0.0

    def __call__(self, time_s: float, dt: float, command: float) -> float:
        if isinstance(self._drive, TrueCoil):
            ohm, henry = self._drive.resistance_ohm, self._drive.inductance_H
            share = -math.expm1(-dt * ohm / henry) if henry > 0 else 1.0
            self.current_A += share * (command / ohm - self.current_A)
            return command if self._lie is None else ohm * self._lie(time_s, command / ohm)
        wanted = command + self._shift if self._lie is None else self._lie(time_s, command)
        if not self._drive.straight:
            return wanted
        most = FASTEST_M_S * dt
        self._at += min(max(wanted - self._at, -most), most)
        if self._lie is not None:
            self._shift = self._at - command
        return self._at

    def end(self) -> None:
        self._lie = None


def zero_of(drive: TrueDrive) -> float:
    """About what a drive's command is reversed or scaled: 0 for current and level; nan, its place, for a carriage."""
    return math.nan if drive.straight else 0.0
