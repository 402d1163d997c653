"""What every estimator of a friction model does with what comes in: late, wrong, or said by the drive."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

from controller.estimator.noise import trusting
from controller.model.control_model import ControlModel
from controller.signals import Estimate, Measurement
from controller.tuned import FilterNoise
from models.theta import bare

_APART = 4 * math.sqrt(2)
"""Standard deviations of a reading by which two of the same place may differ: four of their difference's."""


@dataclass(slots=True)
class Counts:
    """What became of the measurements."""

    accepted: int = 0
    outliers: int = 0
    unusable: int = 0
    restarts: int = 0
    followed: int = 0


class Wrong(Enum):
    """What refused positions say of the belief: nothing yet, that the capsule is elsewhere, that all of it is wrong."""

    NOTHING = 0
    PLACE = 1
    ALL = 2


@dataclass(slots=True)
class Watch:
    """Counts positions taken and refused. Many refused in a row mean that the belief is wrong, not they: a few where
    the capsule may have gone from each reading to the next (it slipped, or stuck, where the model did not), else
    `outliers_in_a_row`: then the readings jumped.
    """

    noise: FilterNoise
    counts: Counts = field(default_factory=Counts)
    accepted_at: float = -math.inf
    refused: int = 0
    proven: int = 0
    jumped: bool = False
    last_m: float = math.nan
    last_s: float = math.nan

    def begin(self, now: float) -> None:
        """A new belief, still to be proven."""
        self.refused, self.proven, self.accepted_at, self.jumped = 0, 0, now, False

    def accept(self, place_m: float, stamp_s: float, now: float) -> None:
        """A position that fits, true at `stamp_s`."""
        self.counts.accepted += 1
        self.refused, self.accepted_at, self.jumped = 0, now, False
        self.proven += 1
        self.last_m, self.last_s = place_m, stamp_s

    def refuse(self, place_m: float, stamp_s: float, now: float) -> Wrong:
        """A position that does not; what it makes of the belief."""
        self.counts.outliers += 1
        self.refused += 1
        n = self.noise
        way_m = n.slip_m_s * abs(stamp_s - self.last_s) + _APART * n.position_std_m
        self.jumped = self.jumped or not abs(place_m - self.last_m) <= way_m
        self.last_m, self.last_s = place_m, stamp_s
        if not self.jumped and self.refused >= n.slips_in_a_row:
            self.counts.followed += 1
            self.refused, self.accepted_at = 0, now
            return Wrong.PLACE
        if self.refused >= n.outliers_in_a_row:
            self.counts.restarts += 1
            return Wrong.ALL
        return Wrong.NOTHING

    def lost(self, now: float, std_m: float) -> bool:
        """Too long without a position, too uncertain, or not proven yet."""
        n = self.noise
        return bool(now - self.accepted_at > n.age_s or not std_m <= n.lost_std_m or self.proven < n.proof)


CURRENT = "coil_current_A"
_MOST_A_TICK = 8  # measurements of a tick that are taken in, the last ones
_FOLLOWS = 3.0  # standard deviations of the carriage, a sent place farther off is its lag


class Estimator(ABC):
    """Position, speed, wall, drive and what friction the model lacks, from localisation (`position_m`) and drive
    feedback.

    A coil's current is a measurement of its state. What a carriage reports replaces what it was told: where they
    differ, the commands since count as off by the same.

    `observe` is called once a tick of the model. A measurement stamped up to `latest_s` ago is taken in at the tick of
    its stamp; the time that this takes is bounded. Never raises.
    """

    def __init__(self, model: ControlModel, noise: FilterNoise | None = None) -> None:
        self.model = model
        self.noise = trusting(model) if noise is None else noise
        self._watch = Watch(self.noise)
        self._kept = math.ceil((self.noise.latest_s + model.delay_s) / model.tick_s) + 2
        self._current = next((k for k, n in enumerate(model.states) if bare(n) == "current_A"), None)

    @property
    def counts(self) -> Counts:
        """What became of the measurements so far."""
        return self._watch.counts

    @property
    def offset(self) -> float:
        """By how much the drive's report is off what it was told, in the command's unit; 0 within its noise."""
        return self._offset

    def reset(self, now: float, command: float) -> None:
        """Know nothing but the `command` in force at `now`; the first position begins a belief."""
        self._count = 0
        self._command = command
        self._innovations: list[float] = []
        self._surprise = math.nan
        self._watch = Watch(self.noise, self.counts)
        self._offset = 0.0

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        """The estimate at `now`, a tick after the last call; `command` was in force since, `measurements` came in
        since.
        """
        if not math.isfinite(command):
            command = self._command
        if self._count:
            self._go_on(now, command)
            self._count = min(self._count + 1, self._kept)
        self._command = command
        self._innovations.clear()
        self._surprise = math.nan
        for m in sorted(measurements[-_MOST_A_TICK:], key=lambda m: m.stamp_s if m.stamp_s == m.stamp_s else math.inf):
            self._take(m, now)
        estimate = self._estimate(now) if self._count else None
        if estimate is None:
            self.counts.restarts += self._count > 0
            self._count = 0
            nothing = self.model.initial() * math.nan
            return Estimate(now, nothing, nothing, 0.0, True)
        return estimate

    def _take(self, m: Measurement, now: float) -> None:
        position = m.channel == "position_m"
        followed = position or (m.channel == CURRENT and self._current is not None)
        if not math.isfinite(m.value + m.stamp_s) or not (followed or m.channel == self.model.command_name):
            self.counts.unusable += 1
            return
        if position and not self._count:
            self._start(m.value, now)
            return
        back = round((now - m.stamp_s + (self.model.delay_s if position else 0.0)) / self.model.tick_s)
        if not 0 <= back < self._count:
            self.counts.unusable += 1
        elif not followed:
            off = m.value - self._told(back)
            self._offset = off if abs(off) > _FOLLOWS * self.noise.carriage_std_m else 0.0
        else:
            size = self._fuse(back, m)
            self._surprise = size if position else self._surprise
            if position and abs(size) <= self.noise.gate:
                self._watch.accept(m.value, m.stamp_s, now)
                self._innovations.append(size)
            elif position:
                self._refused(m, back, now)

    def _refused(self, m: Measurement, back: int, now: float) -> None:
        wrong = self._watch.refuse(m.value, m.stamp_s, now)
        if wrong is Wrong.ALL:
            self._start(m.value, now)
        elif wrong is Wrong.PLACE:
            self._shift(back, m.value)

    def _start(self, position_m: float, now: float) -> None:
        self._begin(position_m, now)
        self._count = 1
        self._watch.begin(now)

    @abstractmethod
    def _begin(self, position_m: float, now: float) -> None:
        """A new belief: at rest at `position_m` under the command in force."""

    @abstractmethod
    def _shift(self, back: int, position_m: float) -> None:
        """The capsule was at `position_m` `back` ticks ago: the belief since, moved there; all else stays."""

    @abstractmethod
    def _go_on(self, now: float, command: float) -> None:
        """A tick on, to `now`; the drive was told `command`, which counts as off by `_offset`."""

    @abstractmethod
    def _told(self, back: int) -> float:
        """What the drive was told `back` ticks ago."""

    @abstractmethod
    def _fuse(self, back: int, m: Measurement) -> float:
        """Take in `m`, true `back` ticks ago; by how many standard deviations it was off what was expected, signed.
        Beyond the gate, or where that is no number, it is an outlier, which changes nothing.
        """

    @abstractmethod
    def _estimate(self, now: float) -> Estimate | None:
        """What is believed; None where it is no longer made of numbers."""
