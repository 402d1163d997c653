"""Whether the model in use still holds: a sequential test on what it forecasts, while it leads."""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from controller.drives import driven_of
from controller.estimator.base import Estimator
from controller.model.control_model import ControlModel, mean_friction
from controller.signals import Estimate

SPAN_S = 1.0
"""How far ahead is foretold."""
LEAST_READINGS = 5
"""Positions that must have come in a second for it to be judged."""
REMEMBERED = 2000
"""Positions by which the estimator's innovations are told how wide they are."""
SHIFT_S = 0.05
"""Of a shift in time that is looked for."""
STEADY_S = 0.4
"""After so long a steady speed is an offset to the estimator, and no delay is told by it."""


@dataclass(frozen=True, slots=True)
class Second:
    """A second that is over, SI: by how much the forecast of the position was off (`miss_m`) and how uncertain begin
    and end were (`std_m`), the mean of the estimator's standardised innovations and their number, how far the capsule
    `moved_m`, and the mean force along +x that the model's own parameters lacked.

    `ahead` is by how many standard deviations the capsule changed its speed earlier than foretold, negative where it
    was late: the score of a shift in time, `sum(i w) / sqrt(sum(w^2))` of the innovations `i`, as shares of their rms
    so far, with `w` the foretold speed less its low-pass over `STEADY_S`. `telling` is what `ahead` would be for a
    shift of `SHIFT_S`: nothing where the speed is steady.
    """

    miss_m: float
    std_m: float
    innovation: float
    readings: int
    moved_m: float
    lacking_N: float
    ahead: float
    telling: float


class Forecast:
    """Runs the model, with the friction level and force that the estimator believes, for `SPAN_S` from an estimate on
    under the commands in force: so far ahead no filter corrects it. `noise_m` is a localisation's standard deviation. A
    second in which the estimate was lost is none: sensors are not judged here. One state a tick.
    """

    def __init__(self, model: ControlModel, noise_m: float) -> None:
        self.model, self._noise_m = model, noise_m
        self._ticks = max(1, round(SPAN_S / model.tick_s))
        self._state, self._numbers = np.zeros((1, len(model.states))), model.values.copy()
        self._force = np.zeros(1)
        self._heard, self._square = 0, 1.0
        self._clear()
        self._share, self._speed = model.tick_s / (STEADY_S + model.tick_s), model.states.index("v")
        self.drop()

    def drop(self) -> None:
        """Forget the second that is under way."""
        self._k, self._time, self._command, self._steady_m_s = -1, math.nan, math.nan, 0.0

    def _clear(self) -> None:
        self._readings, self._sum, self._lacking, self._score, self._weight = 0, 0.0, 0.0, 0.0, 0.0

    def step(self, now: float, command: float, estimate: Estimate) -> Second | None:
        """A tick on, to the `estimate` at `now` which `command` led to; the second that it ends, or None."""
        if estimate.lost or not math.isfinite(command + float(estimate.state[0])):
            self.drop()
            return None
        if self._k < 0:
            self._begin(now, command, estimate)
            return None
        k, model = self.model.kernels, self.model
        before = model.left(self._command, command)
        k.run(self._state, before, command, self._force, self._time, k.tick_s, k.substeps, self._numbers)
        self._k, self._time, self._command = self._k + 1, now, command
        self._lacking += estimate.disturbance_N
        turning = float(self._state[0, self._speed]) - self._steady_m_s
        self._steady_m_s += self._share * turning
        for size in estimate.innovations:
            self._sum, self._readings = self._sum + size, self._readings + 1
            self._score, self._weight = self._score + size * turning, self._weight + turning * turning
            self._heard = min(self._heard + 1, REMEMBERED)
            self._square += (size * size - self._square) / self._heard
        if self._k < self._ticks:
            return None
        found = self._over(estimate) if self._readings >= LEAST_READINGS else None
        self._begin(now, command, estimate)
        return found

    def _begin(self, now: float, command: float, estimate: Estimate) -> None:
        adapted = estimate.adapted
        self._state[0] = estimate.state
        self._numbers[:] = self.model.values if adapted is None else adapted.parameters
        self._force[0] = estimate.disturbance_N if adapted is None else adapted.disturbance_N
        self._k, self._time, self._command = 0, now, command
        self._from, self._std = float(estimate.state[0]), float(estimate.std[0])
        self._clear()

    def _over(self, estimate: Estimate) -> Second | None:
        at = float(estimate.state[0])
        miss, std = at - float(self._state[0, 0]), math.hypot(self._std, float(estimate.std[0]))
        if not math.isfinite(miss + std):
            return None
        mean, lacking, rms = self._sum / self._readings, self._lacking / self._k, math.sqrt(self._square)
        ahead = self._score / (rms * math.sqrt(self._weight) or 1.0)
        telling = SHIFT_S * math.sqrt(self._weight) / (rms * self._noise_m or 1.0)
        return Second(miss, std, mean, self._readings, at - self._from, lacking, ahead, telling)


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
