"""Whether the model in use still holds: a sequential test on what it predicts, while it leads."""

import math
from dataclasses import dataclass
from typing import Final, Literal

from controller.drives import driven_of
from controller.estimator.base import Estimator
from controller.model.friction import mean_friction
from controller.monitor.forecast import SPAN_S, Forecast, Second
from controller.signals import Estimate

State = Literal["holds", "doubtful", "broken", "not watched"]
Change = Literal["", "sudden", "slow"]
FIRST: Final = 16
"""Seconds of motion each way that say what friction is here: a steady offset is what calibration is for."""
DOUBTFUL: Final = 0.5
"""Share of an alarm's evidence from which on the model is doubtful."""
SHIFT: Final = 2.0
"""By how many standard deviations the force that is lacking must at least have changed to count as a drift."""
TELLING: Final = (2.0, 3.0)
"""Standard deviations by which a second must tell a shift in time to be asked for one, and by which it counts at most:
one that tells much does not decide alone.
"""
SURPRISE: Final = 2.3
"""Standard deviations by which forecast or innovations of a second about the beginning of a drift are off where the
change is a sudden one: a slow one surprises nobody.
"""

WIDER = 2.5
"""Of a model that has stopped to hold, by how many times what it predicts is further off than before."""
MOST = 6.0
"""Of one second's evidence, so that no single one raises an alarm."""
ABOUT_S = 3.0
"""Seconds before and after the beginning of a sum that count as about it."""


@dataclass(frozen=True, slots=True)
class Health:
    """What the monitor says: the `state` and since when in s, how the model stopped to hold, the `alarms` so far, and
    the evidence against it as a share of what an alarm takes.
    """

    state: State = "holds"
    since_s: float = 0.0
    change: Change = ""
    alarms: int = 0
    evidence: float = 0.0


NOT_WATCHED: Final = Health("not watched")
"""Of a controller that uses no friction model."""


@dataclass(slots=True)
class Sum:
    """`value` of the evidence so far, since when in s it has not been none, and the greatest `surprise` of the seconds
    about that time.
    """

    value: float = 0.0
    since_s: float = 0.0
    surprise: float = 0.0

    def add(self, evidence: float, began_s: float, surprise: float = 0.0) -> None:
        """Add what a stretch that began at `began_s` says: more than 0 speaks for a change. `surprise` is the greatest
        size of a second about then.
        """
        if not math.isfinite(evidence):
            return
        if self.value <= 0:
            self.since_s, self.surprise = began_s, surprise
        elif began_s - self.since_s <= ABOUT_S:
            self.surprise = max(self.surprise, surprise)
        self.value = max(self.value + min(evidence, MOST), 0.0)


def wider(size: float) -> float:
    """Logarithm of how much likelier `size`, in standard deviations, is where these are `WIDER` times as large."""
    return 0.5 * size * size * (1 - 1 / WIDER**2) - math.log(WIDER)


def shifted(size: float, shift: float) -> float:
    """The same where the mean is `shift` standard deviations above 0."""
    return shift * (size - 0.5 * shift)


class Monitor:
    """Cumulative sums (Page 1954) over seconds in which the capsule moved, all with thresholds of `expected`:

    - forecast: how far off the position was that the model, adapted as it was a second before, foretold;
    - innovations: how far off the estimator's own expectations were on average;
    - time: by how much later than foretold the speed changes, or earlier (a delay, a lag, a clock);
    - drift: the force that the model's own parameters lack, less what it was in the first seconds of motion the same
      way, against the motion and along +x, more and less.

    The first three see a change within seconds; a slow one, which the estimator follows, shows in the drift. A state
    that is broken stays so until `begin`. Sensors are not judged: without an estimate there is no evidence. `look`
    never raises, takes bounded time and allocates nothing that grows.
    """

    def __init__(self, estimator: Estimator) -> None:
        model = estimator.model
        self._estimator = estimator
        self._expected = driven_of(model.drive).expected
        self._forecast = Forecast(model, estimator.noise.position_std_m)
        self._friction_N = max(mean_friction(model), 1e-3)
        self.begin(0.0)

    def begin(self, now: float, alarms: int = 0) -> None:
        """A model begins to lead at `now`, after so many `alarms`: nothing speaks against it yet."""
        self.health = Health("holds", now, "", alarms)
        self._forecast.drop()
        self._off, self._shifted = (Sum(), Sum()), (Sum(), Sum())
        self._slow = (Sum(), Sum(), Sum(), Sum())
        self._before, self._seen = [0.0, 0.0], [0, 0]
        self._recent = [0.0] * int(ABOUT_S)

    def look(self, now: float, command: float, estimate: Estimate) -> Health:
        """A tick on, to the `estimate` at `now`; `command` was in force since the last tick."""
        try:
            second = self._forecast.step(now, command + self._estimator.offset, estimate)
            if second is not None and self.health.state != "broken":
                self.judge(now, second)
        except Exception:  # noqa: BLE001 - a monitor must not stop what it watches
            self._forecast.drop()
        return self.health

    def judge(self, now: float, second: Second) -> None:
        """Add what a `second` that is over at `now` says."""
        e, began = self._expected, now - SPAN_S
        if not abs(second.moved_m) >= e.least_m:
            return
        sizes = (second.miss_m / math.hypot(second.std_m, e.miss_m), second.innovation / e.innovation)
        for one, size in zip(self._off, sizes, strict=True):
            one.add(wider(size), began)
        least, most = TELLING
        ahead, telling = second.ahead / e.ahead, second.telling / e.ahead
        if telling >= least:
            for one, size in zip(self._shifted, (-ahead, ahead), strict=True):
                one.add(shifted(size, min(telling, most)), began)
        self._recent = [*self._recent[1:], max(abs(size) for size in sizes)]
        way = int(second.moved_m < 0)
        lacking = second.lacking_N / self._friction_N
        self._seen[way] += 1
        if self._seen[way] <= FIRST:
            self._before[way] += lacking / FIRST
        else:
            more = (lacking - self._before[way]) / e.lacking
            against = more if way else -more
            for one, size in zip(self._slow, (against, -against, more, -more), strict=True):
                one.add(shifted(size, SHIFT), began, max(self._recent))
        self._say(now)

    def _say(self, now: float) -> None:
        """The state that the sums come to."""
        fast, before = (*self._off, *self._shifted), self.health
        shares = [s.value / self._expected.alarm for s in fast] + [s.value / self._expected.drift for s in self._slow]
        evidence = max(shares)
        if evidence >= 1:
            place = shares.index(evidence)
            first = (*fast, *self._slow)[place]
            change: Change = "slow" if place >= len(fast) and first.surprise < SURPRISE else "sudden"
            self.health = Health("broken", first.since_s, change, before.alarms + 1, evidence)
            return
        state: State = "doubtful" if evidence >= DOUBTFUL else "holds"
        since = before.since_s if state == before.state else now
        self.health = Health(state, since, "", before.alarms, evidence)
