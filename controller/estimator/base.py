"""What all estimators with a friction model share: late, wrong and missing measurements, restarts."""

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final, Protocol

import numpy as np

from controller.drives import driven_of
from controller.model.control_model import AT_FIRST, ControlModel, level_off, proved_off
from controller.signals import Adapted, Array, Estimate, Measurement
from controller.tuned import FilterNoise
from models.theta import bare

START_STD: Final[Mapping[str, float]] = {"v": 1e-3, "u": 1e-4}  # m/s and m, before any measurement
CURRENT: Final = "coil_current_A"
MOST_A_TICK: Final = 8  # newest measurements of a tick that are used
_FOLLOWS: Final = 3.0  # standard deviations of the carriage beyond which a report is an offset
_APART: Final = 4 * math.sqrt(2)
"""Largest difference of two readings of one position, in standard deviations of a reading: four of the difference's."""


@dataclass(slots=True)
class Counts:
    accepted: int = 0
    outliers: int = 0
    unusable: int = 0
    restarts: int = 0
    followed: int = 0


class Wrong(Enum):
    """The conclusion from refused positions: none yet, the capsule is elsewhere, the whole estimate is wrong."""

    NOTHING = 0
    POSITION = 1
    ALL = 2


@dataclass(slots=True)
class Watch:
    """Counts accepted and refused positions. Many refused ones in a row mean that the estimate is wrong. A few are
    enough if the capsule may have moved from each reading to the next (it slipped or stuck, the model did not); after a
    jump of the readings `outliers_in_a_row` are needed.
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
        self.refused, self.proven, self.accepted_at, self.jumped = 0, 0, now, False

    def accept(self, position_m: float, stamp_s: float, now: float) -> None:
        self.counts.accepted += 1
        self.refused, self.accepted_at, self.jumped = 0, now, False
        self.proven += 1
        self.last_m, self.last_s = position_m, stamp_s

    def refuse(self, position_m: float, stamp_s: float, now: float) -> Wrong:
        """A refused position, and the conclusion from it."""
        self.counts.outliers += 1
        self.refused += 1
        most_m = self.noise.slip_m_s * abs(stamp_s - self.last_s) + _APART * self.noise.position_std_m
        self.jumped = self.jumped or not abs(position_m - self.last_m) <= most_m
        self.last_m, self.last_s = position_m, stamp_s
        if not self.jumped and self.refused >= self.noise.slips_in_a_row:
            self.counts.followed += 1
            self.refused, self.accepted_at = 0, now
            return Wrong.POSITION
        if self.refused >= self.noise.outliers_in_a_row:
            self.counts.restarts += 1
            return Wrong.ALL
        return Wrong.NOTHING

    def lost(self, now: float, std_m: float) -> bool:
        """Too long without a position, too uncertain, or not confirmed yet."""
        n = self.noise
        return bool(now - self.accepted_at > n.age_s or not std_m <= n.lost_std_m or self.proven < n.proof)


class Watched:
    _watch: Watch

    @property
    def counts(self) -> Counts:
        return self._watch.counts

    @counts.setter
    def counts(self, counts: Counts) -> None:
        self._watch.counts = counts


def trusting(model: ControlModel) -> FilterNoise:
    """The filter noise of `model`'s drive. If the model's forces were off by f on held-out records (`proved_off`), the
    force wanders by at most f per root second, the level by at most f over the mean friction. Both may initially be off
    by `AT_FIRST` times as much.
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
    """The learned friction level l: the parameter at `index` is (1 + l) times `middle`, the model's own; l lies within
    [`low`, `high`], the parameter's bounds. `values` (p,) are the parameters in use, at first the model's.
    """

    index = 0  # of a surface's parameters, which stand first, the one that scales its friction

    def __init__(self, model: ControlModel) -> None:
        self.values, self._kernels = model.values.copy(), model.kernels
        parameter = model.symbols.parameters[self.index]
        self.middle = float(model.values[self.index])
        self.low, self.high = (bound / self.middle - 1 for bound in (parameter.lower, parameter.upper))
        self._path, self._slopes, self._held = *np.zeros((2, 1, len(model.states))), np.zeros(1)

    def numbers(self, level: float) -> Array:
        """The model's parameters (p,) at `level`."""
        numbers = self.values.copy()
        numbers[self.index] *= 1 + min(max(level, self.low), self.high)
        return numbers

    def adapted(self, state: Array, t: float, level: float, force_N: float) -> tuple[float, Adapted]:
        """The force in N along +x that the model's own parameters lack in the motion `state` (n,) at `t`, and the
        estimate with the parameters of `level`, which lack `force_N`.
        """
        numbers = self.numbers(level)
        self._path[0] = state
        return force_N + self._wall(t, self.values) - self._wall(t, numbers), Adapted(numbers, force_N)

    def _wall(self, t: float, numbers: Array) -> float:
        self._kernels.holds(self._path, self._held, self._slopes, t, self._kernels.tick_s, numbers)
        return float(self._held[0])


class Observer(Protocol):
    """What every estimator is: `offset` in the command's unit is by how much a drive's report is off its command."""

    model: ControlModel
    noise: FilterNoise
    counts: Counts

    @property
    def offset(self) -> float: ...

    def reset(self, now: float, command: float) -> None:
        """Forget all but the `command` in force at `now`; the first position starts an estimate."""
        ...

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        """The estimate at `now`, a tick after the last; `command` in force and `measurements` that arrived since."""
        ...


class Estimator(Watched, ABC):
    """Position, speed, wall, drive and the friction that the model lacks, from localisation (`position_m`) and drive
    feedback.

    A coil's current measures its state. A carriage's report replaces its command: if they differ by more than the
    report's noise, commands count as off by that `offset` in the command's unit.

    `observe` is called once per tick of the model. A measurement up to `latest_s` old is used at the tick of its stamp,
    in bounded time. Never raises.
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

    def reset(self, now: float, command: float) -> None:
        """Forget all but the `command` in force at `now`; the first position starts an estimate."""
        self._count = 0
        self._command = command
        self._innovations: list[float] = []
        self._surprise = math.nan
        self._watch = Watch(self.noise, self.counts)
        self.offset = 0.0

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        """The estimate at `now`, a tick after the last; `command` in force and `measurements` that arrived since."""
        self._command = command if math.isfinite(command) else self._command
        if self._count:
            self._predict(now, self._command + self.offset)
            self._commands.append(self._command)
            self._count = min(self._count + 1, self._kept)
        self._innovations.clear()
        self._surprise = math.nan
        for m in sorted(measurements[-MOST_A_TICK:], key=lambda m: m.stamp_s if m.stamp_s == m.stamp_s else math.inf):
            self._take(m, now)
        found = self._estimate() if self._count else None
        if found is None:
            self.counts.restarts += self._count > 0
            self._count = 0
            nothing = self.model.initial() * math.nan
            return Estimate(now, nothing, nothing, 0.0, True)
        state, std, level, force = found
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
        elif wrong is Wrong.POSITION:
            self._shift(back, m.value)

    def _start(self, position_m: float, now: float) -> None:
        self._commands.clear()
        self._commands.append(self._command)
        self._begin(position_m, now)
        self._count = 1
        self._watch.begin(now)

    @abstractmethod
    def _begin(self, position_m: float, now: float) -> None:
        """Start at rest at `position_m` under the command in force."""

    @abstractmethod
    def _shift(self, back: int, position_m: float) -> None:
        """The capsule was at `position_m` `back` ticks ago: shift the positions since then, leave the rest."""

    @abstractmethod
    def _predict(self, now: float, command: float) -> None:
        """Predict a tick, to `now`, at the end of which the drive is at `command`."""

    @abstractmethod
    def _fuse(self, back: int, m: Measurement) -> float:
        """Use `m`, true `back` ticks ago; its signed normalised innovation. An outlier or NaN changes nothing."""

    @abstractmethod
    def _estimate(self) -> tuple[Array, Array, float, float] | None:
        """State and standard deviations (n,), friction level and force in N; None if not numbers."""
