"""What every estimator of a friction model does with what comes in: late, wrong, or said by the drive."""

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final

import numpy as np

from controller.drives import driven_of
from controller.model.control_model import AT_FIRST, ControlModel, level_off, proved_off
from controller.signals import Adapted, Array, Estimate, Measurement
from controller.tuned import FilterNoise
from models.theta import bare

START_STD: Final[Mapping[str, float]] = {"v": 1e-3, "u": 1e-4}  # m/s and m, before anything was measured
CURRENT: Final = "coil_current_A"
MOST_A_TICK: Final = 8  # measurements of a tick that are taken in, the last ones
_FOLLOWS: Final = 3.0  # standard deviations of the carriage, a sent place farther off is its lag
_APART: Final = 4 * math.sqrt(2)
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
        way_m = self.noise.slip_m_s * abs(stamp_s - self.last_s) + _APART * self.noise.position_std_m
        self.jumped = self.jumped or not abs(place_m - self.last_m) <= way_m
        self.last_m, self.last_s = place_m, stamp_s
        if not self.jumped and self.refused >= self.noise.slips_in_a_row:
            self.counts.followed += 1
            self.refused, self.accepted_at = 0, now
            return Wrong.PLACE
        if self.refused >= self.noise.outliers_in_a_row:
            self.counts.restarts += 1
            return Wrong.ALL
        return Wrong.NOTHING

    def lost(self, now: float, std_m: float) -> bool:
        """Too long without a position, too uncertain, or not proven yet."""
        n = self.noise
        return bool(now - self.accepted_at > n.age_s or not std_m <= n.lost_std_m or self.proven < n.proof)


def trusting(model: ControlModel) -> FilterNoise:
    """The noise of its drive for `model`: where that proved to be off by f on records that it had not seen
    (`proved_off`), the force wanders by no more than f a root second and the level by no more than f over the mean
    friction, and both may be `AT_FIRST` times as far off at the start.
    """
    noise, force, level = driven_of(model.drive).noise, proved_off(model), level_off(model)
    if force is None or level is None:
        return noise
    most = {
        "force_wander_N": force,
        "force_std_N": AT_FIRST * force,
        "level_wander": level,
        "brisk_level_wander": level,
        "level_std": AT_FIRST * level,
        "fitted_level_std": AT_FIRST * level,
    }
    return replace(noise, **{name: min(getattr(noise, name), value) for name, value in most.items()})


class Level:
    """The friction level l that estimators learn makes the parameter at `index` (1 + l) times `middle`, the model's
    own; l within [`low`, `high`], the parameter's bounds.
    """

    index = 0  # of a surface's parameters, which stand first, the one that scales its friction

    def __init__(self, model: ControlModel) -> None:
        self._values, self._kernels = model.values, model.kernels
        parameter = model.symbols.parameters[self.index]
        self.middle = float(model.values[self.index])
        self.low, self.high = (bound / self.middle - 1 for bound in (parameter.lower, parameter.upper))
        self._path, self._slopes, self._held = *np.zeros((2, 1, len(model.states))), np.zeros(1)

    def numbers(self, level: float) -> Array:
        """The model's parameters (p,) at `level`."""
        numbers = self._values.copy()
        numbers[self.index] *= 1 + min(max(level, self.low), self.high)
        return numbers

    def adapted(self, state: Array, t: float, level: float, force_N: float) -> tuple[float, Adapted]:
        """The force in N along +x that the model's own parameters lack in the motion of `state` (n,) at `t`, and the
        same with those of `level`, which lack `force_N`.
        """
        numbers = self.numbers(level)
        self._path[0] = state
        return force_N + self._wall(t, self._values) - self._wall(t, numbers), Adapted(numbers, force_N)

    def _wall(self, t: float, numbers: Array) -> float:
        self._kernels.holds(self._path, self._held, self._slopes, t, self._kernels.tick_s, numbers)
        return float(self._held[0])


class Estimator(ABC):
    """Position, speed, wall, drive and what friction the model lacks, from localisation (`position_m`) and drive
    feedback.

    A coil's current is a measurement of its state. What a carriage reports replaces what it was told: where they
    differ by more than its noise, the commands since count as off by the same, the `offset` in the command's unit.

    `observe` is called once a tick of the model. A measurement stamped up to `latest_s` ago is taken in at the tick of
    its stamp; the time that this takes is bounded. Never raises.
    """

    def __init__(self, model: ControlModel, noise: FilterNoise | None = None) -> None:
        self.model = model
        self.noise = trusting(model) if noise is None else noise
        self.offset = 0.0
        self._watch = Watch(self.noise)
        self._kept = math.ceil((self.noise.latest_s + model.delay_s) / model.tick_s) + 2
        self._commands: deque[float] = deque(maxlen=self._kept)
        self._current = next((k for k, n in enumerate(model.states) if bare(n) == "current_A"), None)
        self._level = Level(model)

    @property
    def counts(self) -> Counts:
        """What became of the measurements so far."""
        return self._watch.counts

    def reset(self, now: float, command: float) -> None:
        """Know nothing but the `command` in force at `now`; the first position begins a belief."""
        self._count = 0
        self._command = command
        self._innovations: list[float] = []
        self._surprise = math.nan
        self._watch = Watch(self.noise, self.counts)
        self.offset = 0.0

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        """The estimate at `now`, a tick after the last; `command` in force and `measurements` come in since."""
        self._command = command if math.isfinite(command) else self._command
        if self._count:
            self._go_on(now, self._command + self.offset)
            self._commands.append(self._command)
            self._count = min(self._count + 1, self._kept)
        self._innovations.clear()
        self._surprise = math.nan
        for m in sorted(measurements[-MOST_A_TICK:], key=lambda m: m.stamp_s if m.stamp_s == m.stamp_s else math.inf):
            self._take(m, now)
        believed = self._believed() if self._count else None
        if believed is None:
            self.counts.restarts += self._count > 0
            self._count = 0
            nothing = self.model.initial() * math.nan
            return Estimate(now, nothing, nothing, 0.0, True)
        state, std, level, force = believed
        lacking, adapted = self._level.adapted(state, now, level, force)
        lost = self._watch.lost(now, float(std[0]))
        return Estimate(now, state, std, lacking, lost, adapted, tuple(self._innovations), self._surprise)

    def _take(self, m: Measurement, now: float) -> None:
        position = m.channel == "position_m"
        followed = position or (m.channel == CURRENT and self._current is not None)
        if not math.isfinite(m.value + m.stamp_s) or not (followed or m.channel == self.model.drive.commanded):
            self.counts.unusable += 1
            return
        if position and not self._count:
            self._start(m.value, now)
            return
        back = round((now - m.stamp_s + (self.model.delay_s if position else 0.0)) / self.model.tick_s)
        if not 0 <= back < self._count:
            self.counts.unusable += 1
        elif not followed:
            off = m.value - self._commands[-1 - back]
            self.offset = off if abs(off) > _FOLLOWS * self.noise.carriage_std_m else 0.0
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
        self._commands.clear()
        self._commands.append(self._command)
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
        """A tick on, to `now`, at the end of which the drive is at `command`."""

    @abstractmethod
    def _fuse(self, back: int, m: Measurement) -> float:
        """Take in `m`, true `back` ticks ago; by how many standard deviations it was off what was expected, signed.
        Beyond the gate, or where that is no number, it is an outlier, which changes nothing.
        """

    @abstractmethod
    def _believed(self) -> tuple[Array, Array, float, float] | None:
        """State and standard deviations (n,), friction level and force in N; None where these are no numbers."""
