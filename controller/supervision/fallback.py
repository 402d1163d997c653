"""The fallback chain: which controllers may be asked, detection of oscillation, blending of change-overs."""

import math
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from controller.tuned import check_numbers


@dataclass(frozen=True)
class Rules:
    """When the supervisor changes over, in s, except `late_allowed` (late answers in a row that are still used),
    `rest_speed_m_s`, `swing_m` and `swings`.

    An answer later than `deadline_s` by the clock is late. A failed controller is tried again after `retry_s`, twice as
    long after each further failure up to `retry_longest_s`; `forgive_s` of good work resets this. Serious limits in
    force for `limit_s` count as a failure, as does an oscillating command far from the aim for `limit_s` (a second of
    following subtracts 0.5 s).

    A controller under which the capsule `swings` times in a row from `swing_m` on one side of the reference to the
    other, each within `swing_s`, must reduce its gain, or has failed. Stick and slip swings by tenths of a millimetre,
    a loop with an unknown delay by several.

    After a lost estimate control resumes once it was good for `settle_s`. A change-over is blended over `blend_s`; a
    stop takes the current to 0 within `stop_s`. At rest: capsule and reference slower than `rest_speed_m_s` for
    `rest_s`.
    """

    late_allowed: int = 2
    deadline_s: float = math.inf
    retry_s: float = 0.25
    retry_longest_s: float = 4.0
    forgive_s: float = 2.0
    limit_s: float = 0.5
    settle_s: float = 0.05
    blend_s: float = 0.1
    stop_s: float = 0.1
    rest_speed_m_s: float = 2e-4
    rest_s: float = 0.2
    swing_m: float = 2e-3
    swing_s: float = 1.5
    swings: int = 4

    def __post_init__(self) -> None:
        check_numbers(self, "rule", finite=False)


@dataclass(frozen=True)
class Event:
    """A change-over at `time_s` from one controller to another, with the reason."""

    time_s: float
    before: str
    after: str
    reason: str


class FallbackChain:
    """Which controllers are suspended, and until when."""

    def __init__(self, count: int, rules: Rules) -> None:
        self._rules = rules
        self._closed_until = [-math.inf] * count
        self._wait = [rules.retry_s] * count
        self._good_since = [math.inf] * count

    def open(self, now: float) -> Iterator[int]:
        """The controllers that may be asked at `now`, best first."""
        for rank, until in enumerate(self._closed_until):
            if now >= until:
                yield rank

    def failed(self, rank: int, now: float) -> None:
        self._closed_until[rank] = max(self._closed_until[rank], now + self._wait[rank])
        self._wait[rank] = min(2 * self._wait[rank], max(self._rules.retry_longest_s, self._rules.retry_s))
        self._good_since[rank] = math.inf

    def ban(self, rank: int) -> None:
        self._closed_until[rank] = math.inf

    @property
    def banned(self) -> bool:
        return all(until == math.inf for until in self._closed_until)

    def worked(self, rank: int, now: float) -> None:
        self._good_since[rank] = min(self._good_since[rank], now)
        if now - self._good_since[rank] >= self._rules.forgive_s:
            self._wait[rank] = self._rules.retry_s


_NEAR: Final = 0.25  # of `swing_m`, least error of a swing that grows
_GROWS: Final = 1.5  # times as far as two swings before
DONE: Final = "done"  # the value of `ended` for a run that went as asked
LED: Final = 0.99  # least share of the ticks with the requested controller in such a run


def shares(led: Counter[str]) -> dict[str, float]:
    """Share of the ticks per controller while the drive was controlled; "stop" without a controller."""
    return {name: count / led.total() for name, count in led.most_common()}


def not_led(led: Counter[str], wanted: str, least: float = LED) -> str:
    """That `wanted` had a smaller share of the ticks than the `least`; else ""."""
    found = shares(led)
    if not found or found.get(wanted, 0.0) >= least:
        return ""
    others = ", ".join(f"{name} {100 * share:.1f} %" for name, share in found.items())
    return f"{wanted} must lead {100 * least:g} % of the ticks; led: {others}"


class Blend:
    """A step that fades linearly to 0 within `time_s`; `left` is the remainder."""

    def __init__(self, time_s: float) -> None:
        self._time, self._step, self._since, self.left = time_s, 0.0, -math.inf, 0.0

    def begin(self, step: float, now: float) -> None:
        """Hide `step` = old command - new command from `now` on."""
        self._step, self._since = step, now

    def smooth(self, command: float, now: float) -> float:
        share = max(0.0, 1 - max(now - self._since, 0.0) / self._time) if self._time > 0 else 0.0
        self.left = self._step * share
        return command + self.left


class Swings:
    """Counts in a row how often the capsule goes from further than `far_m` on one side of its reference to the other,
    within `within_s`. An error on one side is no swing. `growing`: from `_NEAR` of `far_m` on, the
    error came back on both sides to `_GROWS` times as far as two swings before, to half of `far_m` or more.
    """

    def __init__(self, far_m: float, within_s: float) -> None:
        self._far_m, self._within_s = far_m, within_s
        self.forget()

    def forget(self) -> None:
        self.count, self._side, self._far_at, self.growing = 0, 0.0, -math.inf, False
        self._peaks = deque([0.0], maxlen=4)
        self._peak_side, self._peak_at = 0.0, -math.inf

    def see(self, now: float, error_m: float) -> int:
        """Advance to `now` in s; the number of swings so far. An error that is not a number is ignored."""
        if now - self._peak_at > self._within_s:
            self.forget()
        if now - self._far_at > self._within_s:
            self.count, self._side = 0, 0.0
        size, side = abs(error_m), math.copysign(1.0, error_m)
        if size >= _NEAR * self._far_m:
            if side != self._peak_side:
                self._peaks.append(0.0)
            self._peaks[-1], self._peak_side, self._peak_at = max(self._peaks[-1], size), side, now
            self.growing = self.growing or self._grown()
        if size >= self._far_m:
            self.count += side == -self._side
            self._side, self._far_at = side, now
        return self.count

    def _grown(self) -> bool:
        """Whether the last swings on both sides are larger than those before."""
        if len(self._peaks) < 4:
            return False
        first, second, third, last = self._peaks
        return first > 0 and third >= _GROWS * first and last >= max(_GROWS * second, 0.5 * self._far_m)
