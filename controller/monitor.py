"""Whether the model in use still holds: a sequential test on what it forecasts, while it leads."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from controller.drives import driven_of
from controller.estimator.base import Observer
from controller.model.control_model import ControlModel, mean_friction
from controller.signals import Estimate

SPAN_S = 1.0  # length of a forecast
LEAST_READINGS = 5  # positions needed to judge a second
REMEMBERED = 2000  # positions in the rms of the innovations
SHIFT_S = 0.05  # shift in time of the test
STEADY_S = 0.4  # time constant after which a steady speed is an offset for the estimator and shows no delay


@dataclass(frozen=True, slots=True)
class Second:
    """A finished second, SI: the error of the position forecast (`miss_m`), the uncertainty of its ends (`std_m`), the
    mean of the estimator's standardised innovations and their number, the distance `moved_m`, and the mean force along
    +x that the model's own parameters lacked.

    `ahead`: by how many standard deviations the capsule changed its speed earlier than forecast, negative if later: the
    score of a shift in time, `sum(i w) / sqrt(sum(w^2))` of the innovations `i` over their rms, with `w` the forecast
    speed less its low-pass over `STEADY_S`. `sensitivity`: the expected `ahead` for a shift of `SHIFT_S`, 0 at steady
    speed.
    """

    miss_m: float
    std_m: float
    innovation: float
    readings: int
    moved_m: float
    lacking_N: float
    ahead: float
    sensitivity: float


class Forecast:
    """Runs the model, with the estimated friction level and force, for `SPAN_S` from an estimate under the commands in
    force; no filter corrects it. `noise_m`: standard deviation of the localisation. Seconds with a lost estimate do not
    count: sensors are not judged here. One state per tick.
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
        self._k, self._time, self._command, self._steady_m_s = -1, math.nan, math.nan, 0.0

    def _clear(self) -> None:
        self._readings, self._sum, self._lacking, self._score, self._weight = 0, 0.0, 0.0, 0.0, 0.0

    def step(self, now: float, command: float, estimate: Estimate) -> Second | None:
        """Advance a tick, to the `estimate` at `now` which `command` led to; the second that ends here, or None."""
        if estimate.lost or not math.isfinite(command + float(estimate.state[0])):
            self.drop()
            return None
        if self._k < 0:
            self._begin(now, command, estimate)
            return None
        k, model = self.model.kernels, self.model
        before = model.command_from(self._command, command)
        k.run(self._state, before, command, self._force, self._time, k.tick_s, k.substeps, self._numbers)
        self._k, self._time, self._command = self._k + 1, now, command
        self._lacking += estimate.disturbance_N
        change = float(self._state[0, self._speed]) - self._steady_m_s
        self._steady_m_s += self._share * change
        for size in estimate.innovations:
            self._sum, self._readings = self._sum + size, self._readings + 1
            self._score, self._weight = self._score + size * change, self._weight + change * change
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
        sensitivity = SHIFT_S * math.sqrt(self._weight) / (rms * self._noise_m or 1.0)
        return Second(miss, std, mean, self._readings, at - self._from, lacking, ahead, sensitivity)


State = Literal["holds", "doubtful", "broken", "not watched"]
Change = Literal["", "sudden", "slow"]
FIRST: Final = 16  # seconds of motion per direction that set the reference; calibration covers a steady offset
DOUBTFUL: Final = 0.5  # share of an alarm's evidence above which the model is doubtful
SHIFT: Final = 2.0  # least change of the lacking force, in standard deviations, that counts as drift
SENSITIVE: Final = (2.0, 3.0)
"""Least sensitivity of a second to a shift in time that counts, and the greatest one counted."""
SURPRISE: Final = 2.3  # Standard deviations near the beginning of a drift from which the change is sudden

WIDER = 2.5  # factor on the errors of a model that no longer holds
MOST = 6.0  # evidence of one second at most, so that no single one raises an alarm
RECENT: Final = 5  # seconds of motion behind `Monitor.misfit`
ABOUT_S = 3.0  # seconds around the beginning of a sum that count as near it


@dataclass(frozen=True, slots=True)
class Health:
    """The `state` since when in s, how the model changed, the `alarms`, the evidence as a share of an alarm's."""

    state: State = "holds"
    since_s: float = 0.0
    change: Change = ""
    alarms: int = 0
    evidence: float = 0.0


NOT_WATCHED: Final = Health("not watched")  # of a controller without a friction model


@dataclass(slots=True)
class Sum:
    """`value`: the evidence, since when in s it is above 0, and the greatest `surprise` near that time."""

    value: float = 0.0
    since_s: float = 0.0
    surprise: float = 0.0

    def add(self, evidence: float, began_s: float, surprise: float = 0.0) -> None:
        """Add evidence from `began_s` on, above 0 for a change; `surprise`: the largest normalised error near it."""
        if not math.isfinite(evidence):
            return
        if self.value <= 0:
            self.since_s, self.surprise = began_s, surprise
        elif began_s - self.since_s <= ABOUT_S:
            self.surprise = max(self.surprise, surprise)
        self.value = max(self.value + min(evidence, MOST), 0.0)


def wider(size: float) -> float:
    """Log likelihood ratio of `size`, in standard deviations, for errors `WIDER` times as large."""
    return 0.5 * size * size * (1 - 1 / WIDER**2) - math.log(WIDER)


def shifted(size: float, shift: float) -> float:
    """The same for a mean `shift` standard deviations above 0."""
    return shift * (size - 0.5 * shift)


class Monitor:
    """Cumulative sums (Page 1954) over seconds in which the capsule moved, with thresholds of `expected`:

    - forecast: error of the position that the model, as adapted a second before, predicted;
    - innovations: mean error of the estimator's own predictions;
    - time: how much later or earlier than forecast the speed changes (a delay, a lag, a clock);
    - drift: the force that the model's own parameters lack, less its value in the first seconds of motion in the same
      direction, against the motion and along +x, more and less.

    The first three see a change within seconds; a slow change, which the estimator follows, shows in the drift. A
    broken state remains until `begin`. Sensors are not judged: without an estimate there is no evidence. `look` never
    raises, takes bounded time and memory.
    """

    def __init__(self, estimator: Observer) -> None:
        model = estimator.model
        self._estimator = estimator
        self._expected = driven_of(model.drive).expected
        self._forecast = Forecast(model, estimator.noise.position_std_m)
        self._friction_N = max(mean_friction(model), 1e-3)
        self.begin(0.0)

    def begin(self, now: float, alarms: int = 0) -> None:
        """A model takes control at `now`, after so many `alarms`, without evidence against it."""
        self.health = Health("holds", now, "", alarms)
        self._forecast.drop()
        self._off, self._shifted = (Sum(), Sum()), (Sum(), Sum())
        self._slow = (Sum(), Sum(), Sum(), Sum())
        self._before, self._seen = [0.0, 0.0], [0, 0]
        self._recent = [0.0] * int(ABOUT_S)
        self._misfits: deque[float] = deque(maxlen=RECENT)

    @property
    def misfit(self) -> float:
        """Minus the log likelihood of the last `RECENT` seconds of motion, by forecast and innovations; nan before."""
        return sum(self._misfits) if len(self._misfits) == RECENT else math.nan

    def look(self, now: float, command: float, estimate: Estimate) -> Health:
        """Advance a tick, to the `estimate` at `now`; `command` was in force since the last tick."""
        try:
            second = self._forecast.step(now, command + self._estimator.offset, estimate)
            if second is not None and abs(second.moved_m) >= self._expected.least_m:
                self._misfits.append(sum(min(0.5 * size * size, MOST) for size in self._sizes(second)))
                if self.health.state != "broken":
                    self.judge(now, second)
        except Exception:  # noqa: BLE001 - a monitor must not stop what it watches
            self._forecast.drop()
        return self.health

    def judge(self, now: float, second: Second) -> None:
        e, began = self._expected, now - SPAN_S
        if not abs(second.moved_m) >= e.least_m:
            return
        sizes = self._sizes(second)
        for one, size in zip(self._off, sizes, strict=True):
            one.add(wider(size), began)
        least, most = SENSITIVE
        ahead, sensitivity = second.ahead / e.ahead, second.sensitivity / e.ahead
        if sensitivity >= least:
            for one, size in zip(self._shifted, (-ahead, ahead), strict=True):
                one.add(shifted(size, min(sensitivity, most)), began)
        self._recent = [*self._recent[1:], max(abs(size) for size in sizes)]
        side = int(second.moved_m < 0)
        lacking = second.lacking_N / self._friction_N
        self._seen[side] += 1
        if self._seen[side] <= FIRST:
            self._before[side] += lacking / FIRST
        else:
            more = (lacking - self._before[side]) / e.lacking
            against = more if side else -more
            for one, size in zip(self._slow, (against, -against, more, -more), strict=True):
                one.add(shifted(size, SHIFT), began, max(self._recent))
        self._say(now)

    def _sizes(self, second: Second) -> tuple[float, float]:
        e = self._expected
        return second.miss_m / math.hypot(second.std_m, e.miss_m), second.innovation / e.innovation

    def _say(self, now: float) -> None:
        fast, before = (*self._off, *self._shifted), self.health
        shares = [s.value / self._expected.alarm for s in fast] + [s.value / self._expected.drift for s in self._slow]
        evidence = max(shares)
        if evidence >= 1:
            first_at = shares.index(evidence)
            first = (*fast, *self._slow)[first_at]
            change: Change = "slow" if first_at >= len(fast) and first.surprise < SURPRISE else "sudden"
            self.health = Health("broken", first.since_s, change, before.alarms + 1, evidence)
            return
        state: State = "doubtful" if evidence >= DOUBTFUL else "holds"
        since = before.since_s if state == before.state else now
        self.health = Health(state, since, "", before.alarms, evidence)
