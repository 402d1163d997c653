"""The next experiment: the motion that best separates what the records leave confounded, and by how much it would."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from models.checks.excitation import Shown
from models.effects import effect_words
from models.identification.finding import NEXT_CSV, Proposal, Separation
from models.identification.fitting.fit import Fit, axes, evaluate
from models.identification.fitting.fitter import Fitter
from models.identification.intervals import memory
from models.identification.kind import Array, Kind
from models.identification.kinds.series.drive_input import driven_column
from models.identification.kinds.series.series import SeriesKind
from models.identification.motion_plan import DrivePlan, DriveRoom, Plan, Room
from models.identification.search.fitted_model import FittedModel
from models.identification.search.search import Search
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.kinds import KINDS
from models.theta import Theta
from models.words.sentences import Sentences
from models.workers import each

TEXT: Final = Sentences(__file__)


@dataclass(frozen=True)
class Candidate:
    """A model to compare: the `effect` in question, all its `effects` and its values."""

    effect: str
    effects: tuple[str, ...]
    theta: Theta

    def fitted(self, kind: Kind, records: Sequence[Record]) -> Fit:
        """The best fit of `records` near its values."""
        return Fitter.of(kind, records, self.effects).near(self.theta, SET.fine[:1], SET.its_rounds)

    def moved(self, kind: Kind, step: Array) -> Theta:
        """Its values moved by `step` (p,) in the order of the model's axes, within the bounds."""
        pairs = zip(axes(kind, self.effects), step, strict=True)
        ends = [(axis.name, axis.parameter, self.theta[axis.name] + s) for axis, s in pairs]
        return self.theta | {name: float(np.clip(x, p.lower, p.upper)) for name, p, x in ends}


@dataclass(frozen=True)
class Question:
    """Whether `truth` or its `rival` holds, both fitted to the same records.

    `root` (p, p) is a square root of the covariance of the rival's fitted values. `likely` are draws of the truth's own
    values. `variance`, in units of the noise's, is that of a difference on a record: what the truth
    leaves of its own records, times that residual's memory. `apart` says by how many standard deviations each of those
    records separates the two.
    """

    kind: Kind
    truth: Candidate
    rival: Candidate
    root: Array
    likely: tuple[Theta, ...]
    variance: float
    apart: Mapping[str, float]

    def separation(self, motion: Record) -> float:
        """By how many standard deviations a record of `motion` would reject the rival, refitted to it and to the
        present records; to first order in the rival's values.

        The square is twice the expected logarithm of the likelihood ratio. The uncertainty of the truth's own values
        counts as noise.
        """
        seen, variance = self._expected(motion)
        thetas = [self.rival.moved(self.kind, step) for step in self.root.T]
        wrong, *moved = self.kind.stacked(seen, [self.rival.theta, *thetas], self.kind.free_run)
        slopes = np.array([row - wrong for row in moved]).reshape(len(moved), len(wrong)).T
        step = np.linalg.solve(slopes.T @ slopes / variance + np.eye(len(moved)), -slopes.T @ wrong / variance)
        left = wrong + slopes @ step
        return float(np.sqrt(left @ left / variance + step @ step))

    def refitted(self, records: Sequence[Record], motion: Record) -> float:
        """`separation`, or less where a full fit of the rival to `records` and to the truth on `motion` gives less."""
        kind, (seen, variance) = self.kind, self._expected(motion)
        theta = self.rival.fitted(kind, [*records, seen]).theta
        before, after = (evaluate(kind, records, values, kind.free_run) for values in (self.rival.theta, theta))
        left = evaluate(kind, [seen], theta, kind.free_run)
        given_up = max(float(after @ after - before @ before), 0.0) / self.variance
        return min(float(np.sqrt(left @ left / variance + given_up)), self.separation(motion))

    def _expected(self, motion: Record) -> tuple[Record, float]:
        """`motion` with the output that the truth predicts, and the variance of a difference from it."""
        seen = self.kind.made(motion, self.truth.theta)
        unsure = self.kind.stacked(seen, self.likely, self.kind.free_run)
        return seen, self.variance + float(np.mean(np.square(unsure)))


def question(
    kind: Kind, records: Sequence[Record], truth: Candidate, rival: Candidate, rng: np.random.Generator
) -> Question:
    """The question between two models, both refitted to `records`."""
    own, other = (model.fitted(kind, records) for model in (truth, rival))
    variance = max(own.chi2 * memory(own.residual), 1.0)
    truth = replace(truth, theta=truth.theta | own.theta)
    moves = root_of(kind, own, truth.effects, variance)
    likely = tuple(truth.moved(kind, moves @ rng.standard_normal(len(moves))) for _ in range(SET.truths))
    apart = {}
    for record in records:
        left = [evaluate(kind, [record], fit.theta, kind.free_run) for fit in (own, other)]
        more = float(left[1] @ left[1]) - float(left[0] @ left[0])
        apart[record.name] = float(np.sqrt(max(more, 0.0) / variance))
    rival = replace(rival, theta=rival.theta | other.theta)
    return Question(kind, truth, rival, root_of(kind, other, rival.effects, variance), likely, variance, apart)


def root_of(kind: Kind, fit: Fit, effects: Sequence[str], variance: float) -> Array:
    """A square root (p, p) of the covariance of the fitted values; `variance` in units of the noise's."""
    scale = np.array([axis.scale for axis in axes(kind, effects)])
    rows = fit.jacobian * scale / np.sqrt(variance)
    values, vectors = np.linalg.eigh(rows.T @ rows + np.eye(len(scale)) / SET.question_widest**2)
    return np.asarray(scale[:, None] * vectors / np.sqrt(values))


def propose(
    kind: Kind,
    records: Sequence[Record],
    found: Search,
    shown: Shown | None,
    rng: np.random.Generator,
    shows_less: Callable[[Record], frozenset[str]] | None = None,
    *,
    unexplained: bool = False,
) -> Proposal | None:
    """The drive of the next record of a time series; None where nothing is confounded, hidden or `unexplained`, and its
    motion `shows_less` of no effect.

    It is half as long as a record, or 20 s, and stays within the positions of the `records`; where no path is imposed,
    as the model that was found predicts. It separates the effects that are `found` from their rivals by as many
    standard deviations as a bounded search finds. Where there are no rivals, it maximises `shown` (of a motion: the
    hidden effects that it would show, and how rich it is); None: nothing is hidden.
    """
    rig = KINDS[kind.name]
    room = _room(kind, records, kind.nominal() | found.augmented.theta)
    if room is None:
        return None

    def candidate(effect: str, model: FittedModel) -> Candidate:
        return Candidate(effect, model.effects, kind.nominal() | model.thetas[0])

    pairs = [(candidate(effect, m), candidate(rival.effect, rival.fitted)) for effect, m, rival in found.doubts]
    if pairs:
        seconds = (SET.plan_read_s if rig.drawn else SET.slow_plan_read_s) / len(records)
        read = [record.beginning(seconds) for record in records]
        asked = [question(kind, read, *pair, rng) for pair in pairs[: SET.questions]]
        plan, apart = _best(kind, room, asked, read, rng)
    elif shown is None:
        return None
    else:
        asked, apart = [], []
        plan = _richest(room, shown, rng)
    motion = plan.motion
    shows = tuple(sorted({*(shown(motion)[0] if shown else ()), *(shows_less(motion) if shows_less else ())}))
    if not pairs and not shows and not unexplained:
        return None
    times, places = plan.waypoints()
    return Proposal(
        column=room.column,
        times_s=times,
        places_m=places,
        motion={name: motion[name] for name in ("t_s", room.column)},
        separations=tuple(
            Separation(q.truth.effect, q.rival.effect, sure, *max(q.apart.items(), key=lambda row: row[1]))
            for q, sure in zip(asked, apart, strict=True)
        ),
        shows=shows,
    )


def _room(kind: Kind, records: Sequence[Record], theta: Theta) -> Room | DriveRoom | None:
    """What a drive can do; None where it does nothing, and for a kind without a capsule in motion."""
    rig = KINDS[kind.name]
    if rig.led:
        room = Room.of(records, rig.layout.driven[0][0])
        return room if room.speed > 0 and room.span > 0 else None
    if not isinstance(kind, SeriesKind):
        return None
    driven = driven_column(kind.name, records)
    return DriveRoom(kind, tuple(records), theta, driven) if any(np.ptp(r[driven]) for r in records) else None


def _richest(room: Room | DriveRoom, shown: Shown, rng: np.random.Generator) -> Plan | DrivePlan:
    """The random plan that shows most effects; of those the richest."""

    def worth(plan: Plan | DrivePlan) -> tuple[float, int, float]:
        effects, rich = shown(plan.motion)
        return -plan.beyond, len(effects), rich

    return max((room.random(rng) for _ in range(SET.plan_effort[0])), key=worth)


def words_of(proposal: Proposal | None) -> str | None:
    """What is proposed and what it would separate or show; None where nothing is proposed."""
    if proposal is None:
        return None
    said = [TEXT(f"next.{proposal.column}", file=NEXT_CSV, length=proposal.times_s[-1])]
    for effect, group in itertools.groupby(proposal.separations, key=lambda one: one.effect):
        ones = list(group)
        cases = ["next.first", *["next.further"] * (len(ones) - 1)]
        rivals = [TEXT(case, **vars(o) | {"rival": effect_words(o.rival)}) for case, o in zip(cases, ones, strict=True)]
        so_far = min(one.so_far for one in ones)
        case = "next.separates" if so_far < SET.apart else "next.separates_better"
        said.append(TEXT(case, effect=effect_words(effect), rivals=rivals, so_far=so_far))
    if not proposal.separations and not proposal.shows:
        said.append(TEXT("next.unexplained"))
    if proposal.shows:
        said.append(TEXT("next.shows", names=map(effect_words, proposal.shows)))
    return " ".join(said)


def _best(
    kind: Kind, room: Room | DriveRoom, asked: Sequence[Question], read: Sequence[Record], rng: np.random.Generator
) -> tuple[Plan | DrivePlan, list[float]]:
    """The plan whose least separation is largest, and its separations; the last few with the rivals truly fitted."""

    def worth(plan: Plan | DrivePlan) -> float:
        return -plan.beyond or min(q.separation(plan.motion) for q in asked)

    def judged(plans: Sequence[Plan | DrivePlan]) -> list[tuple[float, Plan | DrivePlan]]:
        return list(zip(each(worth, plans), plans, strict=True))

    first, again, best, rounds = SET.plan_effort if KINDS[kind.name].drawn else SET.slow_effort
    rows = judged([room.random(rng) for _ in range(first)])
    for _ in range(rounds):
        rows = sorted(rows, key=lambda row: -row[0])[:best]
        rows += judged([rows[k % best][1].varied(rng) for k in range(again)])
    finals = [plan for _, plan in sorted(rows, key=lambda row: -row[0])[:best]]
    apart = [[q.refitted(read, plan.motion) for q in asked] for plan in finals]
    farthest = max(range(len(finals)), key=lambda k: min(apart[k]))
    return finals[farthest], apart[farthest]
