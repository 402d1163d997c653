"""Families of waveforms whose mean speed grows along the family: from a commanded mean speed to a waveform."""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from controller.limits import Limits
from controller.vibro.cycles import Cycles, Impact, impact_of
from controller.vibro.waveform import REST, Waveform, blend

_STANDS = 0.15e-3  # m/s, mean speed below which the body stands
_ROOM = 0.95  # share of the speed limit: margin for reversals and a rig with less friction
STRENGTHS = tuple(1.08**i for i in range(-22, 20))


@dataclass(frozen=True)
class Gear:
    """`waveforms` whose mean `speeds_m_s`, all of one sign, grow in size; in between levels and period are blended.
    `home_m_s`: the speed its shape was designed for, `impact`: the stop that it strikes there. Raises ValueError for
    speeds that do not grow or change sign.
    """

    waveforms: tuple[Waveform, ...]
    speeds_m_s: tuple[float, ...]
    home_m_s: float
    impact: Impact = "none"

    def __post_init__(self) -> None:
        sizes = [abs(v) for v in self.speeds_m_s]
        if not len(self.waveforms) == len(sizes) >= 2 or any(a >= b for a, b in pairwise(sizes)):
            raise ValueError(f"speeds_m_s must be two or more that grow in size, one a waveform; got {self.speeds_m_s}")
        if min(self.speeds_m_s) < 0 < max(self.speeds_m_s):
            raise ValueError(f"speeds_m_s must be of one sign; got {self.speeds_m_s}")

    @property
    def slowest_m_s(self) -> float:
        return self.speeds_m_s[0]

    @property
    def fastest_m_s(self) -> float:
        return self.speeds_m_s[-1]

    def reaches(self, speed_m_s: float) -> bool:
        return speed_m_s * self.fastest_m_s > 0 and abs(speed_m_s) <= abs(self.fastest_m_s)

    def waveform(self, speed_m_s: float) -> Waveform:
        """The waveform for `speed_m_s`; above its range the fastest, below it the slowest at down to half its strength.
        The model stands there, but a rig with less friction moves on and needs the range.
        """
        size = abs(speed_m_s)
        slowest = abs(self.slowest_m_s)
        if size < slowest:
            return self.waveforms[0].scaled(0.5 + 0.5 * size / slowest)
        sizes = [abs(v) for v in self.speeds_m_s]
        i = bisect_left(sizes, size)
        if i >= len(sizes):
            return self.waveforms[-1]
        if i == 0:
            return self.waveforms[0]
        return blend(self.waveforms[i - 1], self.waveforms[i], (size - sizes[i - 1]) / (sizes[i] - sizes[i - 1]))


def gear_of(cycles: Cycles, shape: Waveform, home_m_s: float) -> Gear | None:
    """The gear of `shape` at weaker and stronger levels. Strengths at which the model's speed does not grow, or its
    body nears the speed limit within a cycle, are left out. None with fewer than two strengths in the direction of
    `home_m_s`.
    """
    direction = 1 if home_m_s > 0 else -1
    path: list[Waveform] = []
    for strength in STRENGTHS:
        wave = shape.scaled(strength)
        if not path or wave.levels != path[-1].levels:
            path.append(wave)
    gaits = [cycles.gait(w) for w in path]
    speeds = [direction * gait.speed_m_s if gait.peak_m_s < _ROOM * Limits().speed_m_s else 0.0 for gait in gaits]
    kept = _longest_rise(speeds)
    if len(kept) < 2:
        return None
    impact = impact_of(cycles.model, cycles.gait(shape))
    return Gear(tuple(path[i] for i in kept), tuple(direction * speeds[i] for i in kept), home_m_s, impact)


def _longest_rise(values: Sequence[float]) -> list[int]:
    """Indices of the longest subsequence that rises by 2 % or more per step, from `_STANDS` on."""
    best: list[list[int]] = []
    for i, value in enumerate(values):
        ends = [chain for chain in best if values[chain[-1]] * 1.02 < value]
        best.append([*max(ends, key=len, default=[]), i] if value > _STANDS else [])
        if not best[-1]:
            best.pop()
    return max(best, key=len, default=[])


@dataclass(frozen=True)
class Choice:
    """A waveform, its gear (None at rest) and its speed on the model; `reachable` if as commanded."""

    waveform: Waveform
    gear: int | None
    speed_m_s: float
    reachable: bool


@dataclass(frozen=True)
class DriveMap:
    """The gears of both directions; `lag_s`: time constant of a change of speed."""

    gears: tuple[Gear, ...]
    lag_s: float

    def reach(self) -> tuple[float, float]:
        """The fastest mean speeds backward (<= 0) and forward (>= 0), m/s."""
        ends = [g.fastest_m_s for g in self.gears]
        return min([0.0, *ends]), max([0.0, *ends])

    def nearest(self, speed_m_s: float) -> int | None:
        """The gear whose home speed is nearest by ratio to `speed_m_s` among those that reach it, None without any."""
        able = [i for i, g in enumerate(self.gears) if g.reaches(speed_m_s)]
        return min(able, key=lambda i: abs(math.log(speed_m_s / self.gears[i].home_m_s)), default=None)

    def choose(self, speed_m_s: float, gear: int | None = None) -> Choice:
        """The waveform for `speed_m_s`, in the given `gear` if that reaches it, else in the nearest that does. A speed
        beyond reach gives that direction's fastest waveform, marked as not reachable, as is a speed that is not a
        number.
        """
        if not math.isfinite(speed_m_s) or abs(speed_m_s) < 1e-6:
            return Choice(REST, None, 0.0, math.isfinite(speed_m_s))
        if gear is None or not self.gears[gear].reaches(speed_m_s):
            gear = self.nearest(speed_m_s)
        if gear is not None:
            return Choice(self.gears[gear].waveform(speed_m_s), gear, speed_m_s, True)
        able = [i for i, g in enumerate(self.gears) if g.fastest_m_s * speed_m_s > 0]
        if not able:
            return Choice(REST, None, 0.0, False)
        fastest = max(able, key=lambda i: abs(self.gears[i].fastest_m_s))
        return Choice(self.gears[fastest].waveforms[-1], fastest, self.gears[fastest].fastest_m_s, False)
