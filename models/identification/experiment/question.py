"""Two models that fit the records about as well, and how far apart a further record would put them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.identification.fitting.confidence import memory
from models.identification.fitting.fit import Axis, Fit, Problem, axes, evaluate
from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class Candidate:
    """A model in question: the effect that it is about, all its effects, its values."""

    effect: str
    effects: tuple[str, ...]
    theta: Theta


@dataclass(frozen=True)
class Question:
    """Whether `truth` or its `rival` holds, both fitted to the same records as a search compares them.

    `root` (p, p): by each of its columns the rival's fitted values may move, a standard deviation. `likely` are draws
    of the truth's own values. `told` is the variance, in units of the noise's, in which what a record would show is
    counted: what the truth leaves of its own records, times that residual's memory. `apart` says by how many standard
    deviations each of those records tells the two apart.
    """

    truth: Candidate
    rival: Candidate
    root: Array
    likely: tuple[Theta, ...]
    told: float
    apart: Mapping[str, float]


def question(
    kind: Kind, records: Sequence[Record], truth: Candidate, rival: Candidate, rng: np.random.Generator
) -> Question:
    """The question between two models, both stepped on to the best fit of `records`."""
    own, other = (_fitted(kind, records, model) for model in (truth, rival))
    told = max(own.chi2 * memory(own.residual), 1.0)
    moves = _root(kind, own, truth.effects, told)
    likely = [_moved(kind, truth, own.theta, moves @ rng.standard_normal(len(moves))) for _ in range(SET.truths)]
    apart = {}
    for record in records:
        left = [evaluate(kind, [record], fit.theta, kind.free_run) for fit in (own, other)]
        more = float(left[1] @ left[1]) - float(left[0] @ left[0])
        apart[record.name] = float(np.sqrt(max(more, 0.0) / told))
    return Question(
        Candidate(truth.effect, truth.effects, truth.theta | own.theta),
        Candidate(rival.effect, rival.effects, rival.theta | other.theta),
        _root(kind, other, rival.effects, told),
        tuple(likely),
        told,
        apart,
    )


def _fitted(kind: Kind, records: Sequence[Record], model: Candidate) -> Fit:
    return Problem.of(kind, records, model.effects).descend(model.theta, SET.fine[0], SET.its_rounds)


def separation(kind: Kind, asked: Question, motion: Record) -> float:
    """How many standard deviations a record of `motion` would put the rival off, fitted to it as well as it can be
    without giving up the records there are; to first order in the rival's values.

    The square is twice the expected logarithm of the likelihood ratio. What the truth's own values leave open counts as
    noise.
    """
    seen, variance = _expected(kind, asked, motion)
    base = asked.rival.theta
    thetas = [_moved(kind, asked.rival, base, step) for step in asked.root.T]
    wrong, *moved = kind.residuals(seen, [base, *thetas], kind.free_run)
    slopes = np.array([row - wrong for row in moved]).reshape(len(moved), len(wrong)).T
    step = np.linalg.solve(slopes.T @ slopes / variance + np.eye(len(moved)), -slopes.T @ wrong / variance)
    left = wrong + slopes @ step
    return float(np.sqrt(left @ left / variance + step @ step))


def refitted(kind: Kind, asked: Question, records: Sequence[Record], motion: Record) -> float:
    """`separation` with the rival truly fitted to `records` and to what the truth would show on `motion`, or to first
    order where that is less.
    """
    criterion = kind.free_run
    seen, variance = _expected(kind, asked, motion)
    problem = Problem.of(kind, [*records, seen], asked.rival.effects, criterion)
    theta = problem.descend(asked.rival.theta, SET.fine[0], SET.its_rounds).theta
    before, after = (evaluate(kind, records, values, criterion) for values in (asked.rival.theta, theta))
    left = evaluate(kind, [seen], theta, criterion)
    given_up = max(float(after @ after - before @ before), 0.0) / asked.told
    return min(float(np.sqrt(left @ left / variance + given_up)), separation(kind, asked, motion))


def _expected(kind: Kind, asked: Question, motion: Record) -> tuple[Record, float]:
    """`motion` with what the truth would show on it, and the variance in which a difference from that counts."""
    seen = motion.with_column(kind.quantity, kind.predict(motion, asked.truth.theta))
    unsure = kind.residuals(seen, asked.likely, kind.free_run)
    return seen, asked.told + float(np.mean(np.square(unsure)))


def _root(kind: Kind, fit: Fit, effects: Sequence[str], told: float) -> Array:
    """A square root (p, p) of the covariance of the fitted values, in the order of the axes."""
    scale = np.array([axis.scale for axis in axes(kind, effects)])
    rows = fit.jacobian * scale / np.sqrt(told)
    values, vectors = np.linalg.eigh(rows.T @ rows + np.eye(len(scale)) / SET.question_widest**2)
    return np.asarray(scale[:, None] * vectors / np.sqrt(values))


def _moved(kind: Kind, model: Candidate, theta: Theta, step: Array) -> Theta:
    """`theta` moved by `step` (p,) in the order of the model's axes, within the bounds."""
    fitted: list[Axis] = axes(kind, model.effects)
    ends = [(axis.name, axis.parameter, theta[axis.name] + s) for axis, s in zip(fitted, step, strict=True)]
    return model.theta | theta | {name: float(np.clip(x, p.lower, p.upper)) for name, p, x in ends}
