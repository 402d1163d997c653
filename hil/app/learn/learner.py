"""From a broken model to a better one: gather, identify in the background, offer, watch, take back."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import asdict, dataclass, field
from typing import Any, Final, Literal

import numpy as np

from controller.drives import bodies
from controller.model.control_model import ControlModel
from controller.monitor import Health
from controller.reference import Experiment
from controller.signals import Array
from controller.supervision.acceptance import Acceptance
from controller.supervision.model_switch import History, ModelSwitch, Offer, Prepared
from hil.app.learn.compared import Led
from hil.app.learn.identify import LEAD_S, TEXT, Ask, LearningAnswer, LearningQuestion, Motion, at_once
from hil.app.scenario.deployment_tables import LearningTable
from hil.app.scenario.model_use import Offered
from hil.log.record import SOURCES
from models.effects import effect_words
from models.rigs.columns import TIME
from models.rigs.rig import Rig
from models.theta import Theta

Phase = Literal["watching", "gathering", "identifying", "preparing", "offered", "on trial"]
Beside = Callable[[Callable[[], Prepared]], "Future[Prepared]"]  # Runs a long computation, beside the ticks or at once
STROKES: Final = ((1.0, 1.0), (-1.0, 0.5), (0.5, 2.0), (-0.5, 2.0), (0.5, 0.5), (0.0, 1.0))
"""Strokes one after the other, each with a rest: its end as a share of the reach, its speed as a share."""
REST_S: Final = 0.5  # after each motion
MM: Final = 1e-3  # in metres
_LEAST_S: Final = 0.1  # of a motion


def check_learnt(rig: Rig) -> None:
    """Raises ValueError for a rig whose runs give no record to identify from."""
    if rig.kind not in bodies():
        raise ValueError(f"--learn must stand with a rig of kind {' or '.join(bodies())}; got {rig.kind}")


@dataclass
class Lesson:
    """One attempt to learn a model after the model in use broke. Times in s of the reference, None for steps not
    reached. `wanted` is the experiment that the search proposes, `answers` counts its answers, `searched_s` is its
    time.
    """

    broken_at_s: float
    effects: tuple[str, ...] = ()
    verdict: str = ""
    sentence: str = ""
    offered_at_s: float | None = None
    taken_at_s: float | None = None
    withdrawn_at_s: float | None = None
    asked_at_s: float | None = None
    answered_at_s: float | None = None
    experiment_at_s: float | None = None
    answers: int = 0
    wanted: str = ""
    searched_s: float = 0.0

    def document(self) -> dict[str, Any]:
        return {**asdict(self), "effects": list(self.effects)}

    @property
    def words(self) -> str:
        values: dict[str, Any] = asdict(self) | {"effects": [*map(effect_words, self.effects)] or [TEXT("no_effect")]}
        if self.offered_at_s is None:
            more = TEXT("wanted", **values) if self.wanted else ""
            result = TEXT("not_offered", **values) + more if self.sentence else TEXT("nothing")
        else:
            taken = TEXT("not_taken" if self.taken_at_s is None else "taken", **values)
            taken += "" if self.withdrawn_at_s is None else TEXT("withdrawn", **values)
            partly = self.verdict == "unknown" and self.effects
            result = TEXT("partly" if partly else "found", taken=taken, **values)
        result = result if self.experiment_at_s is None else TEXT("experiment", result=result, **values)
        return TEXT("since", result=result, **values)


@dataclass
class Learner:
    """Learns while a controller leads; `step` runs once a tick, with one lesson at a time. An offered model has passed
    the acceptance test on held-out data and tracks best in what is `led`; `ModelSwitch` takes it at a rest. `keep` gets
    the `offers` and `experiments` that a replay needs; controllers of a new model are built `beside` the ticks.
    """

    switch: ModelSwitch
    rig: Rig
    values: Theta
    believed: Callable[[Theta], ControlModel]
    ask: Ask
    learning: LearningTable = field(default_factory=LearningTable)
    beside: Beside = at_once
    keep: Callable[[Mapping[str, Any]], object] = lambda record: None
    drive: Callable[[Experiment], object] = lambda experiment: None
    led: Led | None = None

    def __post_init__(self) -> None:
        check_learnt(self.rig)
        sources = SOURCES[self.rig.kind]
        self._driven, self._measured = sources.driven.column, sources.measured.column
        self.switch.history = History((self._driven, self._measured))
        self.lessons: list[Lesson] = []
        self.offers: list[Offered] = []
        self.experiments: list[Experiment] = []
        self._phase: Phase = "watching"
        self._squares, self._sum = deque[float](maxlen=round(self.learning.trial_s / self.switch.tick_s)), 0.0
        self._future: Future[LearningAnswer] | None = None
        self._made: Future[Prepared] | None = None
        self._next: tuple[Theta, Phase] = (self.values, "offered")
        self._due = self._before = self._since = math.nan
        self._led_from = -math.inf
        self._old: Theta = self.values
        self._new: Theta = self.values

    def step(self, now: float, health: Health, error_m: float) -> None:
        """One tick: `now` and `health` by the clock of the switch, `error_m` the estimated tracking error."""
        if math.isfinite(error_m):
            oldest = self._squares[0] if len(self._squares) == self._squares.maxlen else 0.0
            self._sum += error_m * error_m - oldest
            self._squares.append(error_m * error_m)
        if self._phase == "watching" and health.state == "broken":
            self.lessons.append(Lesson(self._reference_s(health.since_s)))
            self._since = health.since_s
            self._due, self._phase = max(health.since_s + self.learning.gathered_s, now), "gathering"
        elif self._phase == "gathering" and now >= self._due:
            self._question(now)
        elif self._phase == "identifying":
            self._wait(now)
        elif self._phase == "preparing":
            self._put(now)
        elif self._phase == "offered" and self.switch.taken_at > (self.lessons[-1].offered_at_s or 0.0):
            self.lessons[-1].taken_at_s, self._led_from = self.switch.taken_at, now
            self._before, self._due, self._phase = self._rms_m, now + self.learning.trial_s, "on trial"
        elif self._phase == "on trial" and now >= self._due:
            self._try(now)

    def _question(self, now: float) -> None:
        columns = self._columns(max(self._since - LEAD_S - self.learning.gathered_s, self._led_from))
        held_s = now - self.learning.held_out_share * self.learning.gathered_s
        broken_from, held_from = (int(row) for row in np.searchsorted(columns[TIME], (self._since, held_s)))
        self.lessons[-1].asked_at_s = self._reference_s(now)
        base_holds = self.lessons[-1].answers % 2 == 0
        since = held_from, self._new, base_holds, broken_from
        self._future = self.ask(LearningQuestion(self.rig, columns, *since, self.led))
        self._due, self._phase = now + self.learning.answer_s, "identifying"

    def _columns(self, begin_s: float) -> dict[str, Array]:
        """Rows at the times of the measured values; the driven column is interpolated."""
        assert self.switch.history is not None
        times, values = self.switch.history.since(self._measured, begin_s)
        at, driven = self.switch.history.since(self._driven, begin_s - 1.0)
        inside = (times >= at[0]) & (times <= at[-1]) if at.size else np.zeros(times.shape, dtype=bool)
        return {
            TIME: times[inside],
            self._driven: np.interp(times[inside], at, driven) if at.size else times[inside],
            self._measured: values[inside],
        }

    def _wait(self, now: float) -> None:
        assert self._future is not None
        if not self._future.done() if math.isinf(self.learning.answer_s) else now < self._due:
            return
        found = self._future.result()
        lesson = self.lessons[-1]
        lesson.effects, lesson.verdict, lesson.sentence = found.effects, found.verdict, found.sentence
        lesson.answered_at_s, lesson.wanted = self._reference_s(now), found.wanted
        lesson.answers, lesson.searched_s = lesson.answers + 1, round(found.seconds, 1)
        if not found.passed:
            self._phase = "gathering"
            self._due = now + self.learning.gathered_s + self._excite(now, found)
            return
        self._old, self._new = self._new, found.values
        self._prepare(now, found.values, "offered")

    @property
    def record(self) -> dict[str, Any]:
        return {
            "learned": [one.document() for one in self.offers],
            "experiments": [one.document() for one in self.experiments],
        }

    def _excite(self, now: float, found: LearningAnswer) -> float:
        """Drive an experiment; its seconds, 0 where `[learning]` allows none or no search took place."""
        experiment = experiment_of(found.motion, self.learning, self._reference_s(now)) if found.searched else None
        if experiment is None:
            return 0.0
        self.lessons[-1].experiment_at_s = experiment.at_s
        self.experiments.append(experiment)
        self.keep(self.record)
        self.drive(experiment)
        return experiment.path.end_s

    def _prepare(self, now: float, values: Theta, then: Phase) -> None:
        """Have the controllers of a model built; the phase is `then` once it is on offer."""
        self._next, self._phase = (values, then), "preparing"
        self._made = self.beside(lambda: self.switch.prepare(Offer(self.believed(values), Acceptance())))
        self._put(now)

    def _put(self, now: float) -> None:
        """Put the prepared model on offer, from half a tick after `now` on."""
        assert self._made is not None
        if not self._made.done():
            return
        values, self._phase = self._next
        lesson, error = self.lessons[-1], self._made.exception()
        if error is not None:
            lesson.sentence, self._phase = f"no controller can use it: {error}", "watching"
            return
        at_s = self._reference_s(now) + 0.5 * self.switch.tick_s
        self.switch.put(self._made.result().at(at_s))
        self.offers.append(Offered(values, at_s))
        self.keep(self.record)
        if self._phase == "offered":
            lesson.offered_at_s = at_s
        else:
            lesson.withdrawn_at_s = at_s

    @property
    def _rms_m(self) -> float:
        return math.sqrt(max(self._sum, 0.0) / len(self._squares)) if self._squares else math.nan

    def _reference_s(self, at: float) -> float:
        origin = self.switch.origin_s
        return at - origin if math.isfinite(origin) else at

    def _try(self, now: float) -> None:
        """Keep the learned model, or take it back where it tracked worse."""
        if self._rms_m > self.learning.worse * self._before:
            self._new, self._led_from = self._old, now
            self._prepare(now, self._old, "watching")
        else:
            self._phase = "watching"


def experiment_of(motion: Motion, learning: LearningTable, at_s: float) -> Experiment | None:
    """As much of `motion` as `learning` allows, or `STROKES` where there is none; None where it allows nothing."""
    reach, speed = MM * learning.experiment_mm, MM * learning.experiment_mm_s
    if not reach:
        return None
    if any(motion[1]):
        times, places = (np.array(values) for values in motion)
        end = min(float(times[-1]), learning.experiment_s)
        at = np.append(times[times < end], end)
        wanted = np.interp(at, times, places)
        wanted *= min(1.0, reach / float(np.max(np.abs(wanted), initial=1e-12)))
        steps = [(float(t), float(x)) for t, x in zip(at, wanted, strict=True)]
    else:
        steps, here, now = [(0.0, 0.0)], 0.0, 0.0
        for share, faster in STROKES:
            end_m = share * reach
            now += max(abs(end_m - here) / (faster * speed), _LEAST_S)
            steps += [(now, end_m), (now + REST_S, end_m)]
            here, now = end_m, now + REST_S
            if now > learning.experiment_s:
                break
    end, last = steps[-1]
    if last:
        steps.append((end + max(abs(last) / speed, _LEAST_S), 0.0))
    times_s, places_m = zip(*steps, strict=True)
    return Experiment(tuple(times_s), tuple(places_m), at_s)
