"""One identification in the background: from records of a run to a model that passed the acceptance test."""

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Final, Self, TypeVar

import numpy as np

from controller.drives import CARRIAGE
from controller.signals import Array
from controller.supervision.acceptance import BETTER, judge
from hil.app.learn.compared import Led, compared
from hil.log.record import SOURCES
from hil.own_process import error_text
from models.assembly.model import effect_parameters
from models.checks.usable import counted, from_row
from models.identification import close
from models.identification.finding import STAGES, Proposal
from models.identification.fitting.fit import evaluate
from models.identification.fitting.fitter import Fitter
from models.identification.kind import Kind
from models.identification.kinds import Known, kind_for, ready
from models.identification.kinds.reports import AnyKind
from models.identification.kinds.series.series import SeriesKind
from models.identification.model import HELD_OUT
from models.parameter import Name
from models.records.record import Record
from models.rigs.columns import TIME
from models.rigs.rig import Rig
from models.theta import Theta
from models.words.sentences import Quantity, Sentences

TEXT: Final = Sentences(__file__)
T = TypeVar("T")
Motion = tuple[tuple[float, ...], tuple[float, ...]]  # Times in s and positions in m from 0 on
KNOWN: Final = 0.01  # Relative standard deviation with which the base parameters of a model that held are known
BELIEVED: Final = 0.05  # The same while a model is fitted to what was measured before it broke
_ROUNDS = 4  # of the iteration for the noise
_AS_STATED = 1.05  # rms of the residuals in units of the noise, up to which the noise is accepted
LEAD_S: Final = 8.0
"""A record is simulated from this long before its first row that counts: gap and stretch depend on the past."""
HELD_S: Final = 10.0  # Shortest time before the break from which the residual of the model is taken
ONE: Final = 1  # Effects that one answer searches for; the next answer starts from the model with it
PARTLY: Final = 0.5  # Largest share of the present held-out error that a model with the verdict `unknown` may have
STEP_M: Final = 1e-3  # Length of wall over which the residual counts as one value
LEAST: Final = 20  # readings that make such a value


@dataclass(frozen=True)
class LearningQuestion:
    """The `columns` of a run of `rig`: rows from `broken_from` on to learn from, those from `held_from` on held out.
    The base of the `values` in use is known where `base_holds`. What passes must track best in what it is to be `led`.
    """

    rig: Rig
    columns: Mapping[str, Array]
    held_from: int
    values: Theta
    base_holds: bool = True
    broken_from: int = 0
    led: Led | None = None

    @property
    def in_use(self) -> Theta:
        return Theta({k: v for k, v in self.values.base.items() if k != HELD_OUT}, self.values.effects)


@dataclass(frozen=True)
class LearningAnswer:
    """What was found: `values` (empty where none passed the acceptance test), `effects`, `verdict`, the reason in a
    sentence, and the next experiment (`wanted`, `motion`). `searched` is False where the process died.
    """

    values: Theta
    effects: tuple[str, ...]
    verdict: str
    sentence: str
    wanted: str = ""
    seconds: float = 0.0
    motion: Motion = ((), ())
    searched: bool = True

    @property
    def passed(self) -> bool:
        return bool(self.values)


Ask = Callable[[LearningQuestion], "Future[LearningAnswer]"]


def answer(question: LearningQuestion) -> LearningAnswer:
    """Identify on the first rows, judge on the held-out rows. Never raises: a failure is an answer, too."""
    try:
        return _answer(question)
    except Exception as error:  # noqa: BLE001 - records of a running rig may be unusable in many ways
        return LearningAnswer(Theta(), (), "none", TEXT("failed", why=error_text(error, 300)))


def at_once(work: Callable[[], T]) -> Future[T]:
    """The result of `work`, for which simulated time waits."""
    done: Future[T] = Future()
    try:
        done.set_result(work())
    except Exception as error:  # noqa: BLE001 - raised where the result is asked for, as from another thread
        done.set_exception(error)
    return done


def answer_at_once(question: LearningQuestion) -> Future[LearningAnswer]:
    return at_once(lambda: answer(question))


def _answer(question: LearningQuestion) -> LearningAnswer:
    cut, (rig, before, columns) = question.held_from, _before_the_break(question)
    train = [_part("since", rig, columns, question.broken_from, cut)]
    held = [_part("held out", rig, columns, cut, None)]
    kind, records = kind_for(rig, []), [ready(record, rig) for record in held]
    known = _known(kind, before, *((KNOWN, KNOWN) if question.base_holds else (np.inf, np.inf)))
    finding, model = close(rig, train, held, lambda _what, _share: None, known=known, most=ONE, drawn=False)
    effects = tuple(effect.id for effect in finding.effects)
    used = kind.nominal() | question.in_use
    error = kind.error(records, [kind.predict(r, used) for r in records])
    report = {"error": finding.error}
    stage = STAGES[2] if effects else STAGES[1]
    share = PARTLY if finding.verdict == "unknown" else BETTER
    verdict = judge(report, model, rig, stage=stage, current=float(error), share=share)
    unfounded = question.base_holds and not effects
    if unfounded or not verdict.passed:
        wanted = finding.next_experiment or ""
        motion = motion_of(finding.proposal)
        why = TEXT("unfounded") if unfounded else verdict.sentence
        return LearningAnswer(Theta(), effects, finding.verdict, why, wanted, finding.seconds, motion)
    tracks = None if question.led is None else compared(question.led, question.rig, model, stage)
    why = TEXT("uncompared") if tracks is None else tracks.why
    if tracks is not None and tracks.stage != stage:
        return LearningAnswer(Theta(), effects, finding.verdict, TEXT("loses", why=why), seconds=finding.seconds)
    errors = Quantity(finding.error["holdout"][stage], finding.unit), Quantity(error, finding.unit)
    said = TEXT("better", error=errors[0], present=errors[1], why=why)
    return LearningAnswer(model.believed(stage), effects, finding.verdict, said, seconds=finding.seconds)


def _before_the_break(question: LearningQuestion) -> tuple[Rig, Theta, Mapping[str, Array]]:
    """The model fitted to what was measured while it held, the columns less the `WallResidual` of that fit, and the rig
    with the rest as noise. Without change where the prediction drifts or the time was short.
    """
    rig, columns, end = question.rig, question.columns, question.broken_from
    times = columns[TIME]
    begin = int(np.searchsorted(times, times[0] + LEAD_S))
    if rig.kind != CARRIAGE.name or times[end] - times[0] < LEAD_S + HELD_S:
        return rig, question.in_use, columns
    driven, measured = SOURCES[rig.kind].driven.column, SOURCES[rig.kind].measured.column
    before = ready(_part("before", rig, columns, begin, end), rig)
    whole = ready(_part("whole", rig, columns, begin, None), rig)
    refitted = _refitted(rig, before, question.in_use)
    kind = kind_for(rig, [before])
    uneven = WallResidual.of(kind, before, refitted, driven)
    predicted = np.zeros(times.size)
    predicted[times.size - len(whole) :] = kind.predict(whole, refitted)
    less = {**columns, measured: columns[measured] - uneven.at(predicted, columns[driven])}
    return _as_noisy(rig, ready(_part("before", rig, less, begin, end), rig), refitted), refitted, less


def motion_of(proposal: Proposal | None) -> Motion:
    """The motion, from 0 on, that a search proposes to separate effects; two empty tuples where it proposes none."""
    if proposal is None or not proposal.separations:
        return (), ()
    times, places = proposal.times_s - proposal.times_s[0], proposal.places_m - proposal.places_m[0]
    return tuple(times.tolist()), tuple(places.tolist())


@dataclass(frozen=True)
class WallResidual:
    """The residual of a model before it broke, by position and direction, so that an uneven gut does not count as the
    cause: median of measured less predicted about `positions_m` (n,), led `forth` and `back`; 0 with too few readings.
    """

    positions_m: Array
    forth: Array
    back: Array

    @classmethod
    def of(cls, kind: Kind, record: Record, theta: Theta, driven: str) -> Self:
        """The residual of `record` under the model `theta`; the column `driven` leads the capsule."""
        predicted = np.asarray(kind.predict(record, theta))
        residual, rows = kind.measured(record) - predicted, counted(record)
        forth = record[driven] >= predicted
        cells = np.round(predicted / STEP_M).astype(int)
        found = np.arange(cells[rows].min(), cells[rows].max() + 1)
        here = [[rows & (forth == sense) & (cells == cell) for cell in found] for sense in (True, False)]
        medians = [[float(np.median(residual[at])) if at.sum() >= LEAST else 0.0 for at in cell] for cell in here]
        return cls(found * STEP_M, *(np.array(values) for values in medians))

    def at(self, predicted: Array, led_to: Array) -> Array:
        """Its value at each of the `predicted` positions (n,) of a capsule that is led to `led_to` (n,)."""
        values = (np.interp(predicted, self.positions_m, one, 0.0, 0.0) for one in (self.forth, self.back))
        return np.where(led_to >= predicted, *values)


def _known(kind: AnyKind, values: Theta, base: float, effects: float) -> Known:
    """Priors of a search: the base with the relative standard deviation `base` (inf: as in the rig file), effects with
    `effects` (for a phase or a zero: relative to the range).
    """
    fitted = [(p, values.get(p.name, p.value)) for p in kind.base if p.fit]
    known: dict[Name, tuple[float, float]]
    known = {p.name: (value, base * abs(value)) for p, value in fitted if value and np.isfinite(base)}
    for p in effect_parameters([kind.catalogue[name] for name in sorted(values.effects)]):
        value = values.get(p.key, p.value)
        size = abs(value) if value and p.role != "phase" else p.upper - p.lower
        known[p.key] = (value, effects * size)
    return known


def _refitted(rig: Rig, before: Record, in_use: Theta) -> Theta:
    """The parameters `in_use`, their base fitted to the record `before` within `BELIEVED`."""
    plain = kind_for(rig, [before])
    kind = kind_for(rig, [before], _known(plain, in_use, np.inf, BELIEVED))
    start = kind.nominal() | in_use
    noisy = _as_noisy(rig, before, Fitter.of(kind, [before], []).far([start]).theta)
    believed = kind_for(noisy, [before], _known(plain, in_use, BELIEVED, BELIEVED))
    return Fitter.of(believed, [before], []).far([start]).theta


def _as_noisy(rig: Rig, record: Record, theta: Theta) -> Rig:
    """`rig` with its noise raised to the residual of `record`, in rounds: averages that judge noise grow with it."""
    for _ in range(_ROUNDS):
        kind = kind_for(rig, [record])
        assert isinstance(kind, SeriesKind)
        residual = evaluate(kind, [record], theta, kind.free_run)
        ratio = float(np.sqrt(residual @ residual / residual.size))
        if ratio <= _AS_STATED:
            break
        rig = replace(rig, noise=rig.noise.model_copy(update={"position_std_m": ratio * kind.noise_std}))
    return rig


def _part(name: str, rig: Rig, columns: Mapping[str, Array], begin: int, end: int | None) -> Record:
    """Rows from `begin` to before `end` count; those of `LEAD_S` before give the state at `begin`. What goes on in time
    goes by the run's clock, as in the controller.
    """
    times = columns[TIME]
    first = int(np.searchsorted(times, times[begin] - LEAD_S))
    part = {key: np.asarray(values[first:end]) for key, values in columns.items()}
    part[TIME] = part[TIME] - part[TIME][0]
    return from_row(Record(name, rig.kind, part, began_s=float(times[first])), begin - first)
