"""Two models that fit the records about as well, and how far apart a further record would put them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.identification.fitting.confidence import memory
from models.identification.fitting.fit import Fit, Problem, axes, evaluate
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

    def fitted(self, kind: Kind, records: Sequence[Record]) -> Fit:
        """Stepped on to the best fit of `records`."""
        return Problem.of(kind, records, self.effects).descend(self.theta, SET.fine[0], SET.its_rounds)

    def moved(self, kind: Kind, step: Array) -> Theta:
        """Its values moved by `step` (p,) in the order of the model's axes, within the bounds."""
        pairs = zip(axes(kind, self.effects), step, strict=True)
        ends = [(axis.name, axis.parameter, self.theta[axis.name] + s) for axis, s in pairs]
        return self.theta | {name: float(np.clip(x, p.lower, p.upper)) for name, p, x in ends}


@dataclass(frozen=True)
class Question:
    """Whether `truth` or its `rival` holds, both fitted to the same records as a search compares them.

    `root` (p, p): by each of its columns the rival's fitted values may move, a standard deviation. `likely` are draws
    of the truth's own values. `told` is the variance, in units of the noise's, in which what a record would show is
    counted: what the truth leaves of its own records, times that residual's memory. `apart` says by how many standard
    deviations each of those records tells the two apart.
    """

    kind: Kind
    truth: Candidate
    rival: Candidate
    root: Array
    likely: tuple[Theta, ...]
    told: float
    apart: Mapping[str, float]

    def separation(self, motion: Record) -> float:
        """How many standard deviations a record of `motion` would put the rival off, fitted to it as well as it can be
        without giving up the records there are; to first order in the rival's values.

        The square is twice the expected logarithm of the likelihood ratio. What the truth's own values leave open
        counts as noise.
        """
        seen, variance = self._expected(motion)
        thetas = [self.rival.moved(self.kind, step) for step in self.root.T]
        wrong, *moved = self.kind.residuals(seen, [self.rival.theta, *thetas], self.kind.free_run)
        slopes = np.array([row - wrong for row in moved]).reshape(len(moved), len(wrong)).T
        step = np.linalg.solve(slopes.T @ slopes / variance + np.eye(len(moved)), -slopes.T @ wrong / variance)
        left = wrong + slopes @ step
        return float(np.sqrt(left @ left / variance + step @ step))

    def refitted(self, records: Sequence[Record], motion: Record) -> float:
        """`separation`, or less where the rival truly fitted to `records` and to the truth on `motion` gives it."""
        kind, (seen, variance) = self.kind, self._expected(motion)
        theta = self.rival.fitted(kind, [*records, seen]).theta
        before, after = (evaluate(kind, records, values, kind.free_run) for values in (self.rival.theta, theta))
        left = evaluate(kind, [seen], theta, kind.free_run)
        given_up = max(float(after @ after - before @ before), 0.0) / self.told
        return min(float(np.sqrt(left @ left / variance + given_up)), self.separation(motion))

    def _expected(self, motion: Record) -> tuple[Record, float]:
        """`motion` with what the truth would show on it, and the variance in which a difference from that counts."""
        seen = motion.with_column(self.kind.quantity, self.kind.predict(motion, self.truth.theta))
        unsure = self.kind.residuals(seen, self.likely, self.kind.free_run)
        return seen, self.told + float(np.mean(np.square(unsure)))


def question(
    kind: Kind, records: Sequence[Record], truth: Candidate, rival: Candidate, rng: np.random.Generator
) -> Question:
    """The question between two models, both stepped on to the best fit of `records`."""
    own, other = (model.fitted(kind, records) for model in (truth, rival))
    told = max(own.chi2 * memory(own.residual), 1.0)
    truth = replace(truth, theta=truth.theta | own.theta)
    moves = _root(kind, own, truth.effects, told)
    likely = tuple(truth.moved(kind, moves @ rng.standard_normal(len(moves))) for _ in range(SET.truths))
    apart = {}
    for record in records:
        left = [evaluate(kind, [record], fit.theta, kind.free_run) for fit in (own, other)]
        more = float(left[1] @ left[1]) - float(left[0] @ left[0])
        apart[record.name] = float(np.sqrt(max(more, 0.0) / told))
    rival = replace(rival, theta=rival.theta | other.theta)
    return Question(kind, truth, rival, _root(kind, other, rival.effects, told), likely, told, apart)


def _root(kind: Kind, fit: Fit, effects: Sequence[str], told: float) -> Array:
    """A square root (p, p) of the covariance of the fitted values, in the order of the axes."""
    scale = np.array([axis.scale for axis in axes(kind, effects)])
    rows = fit.jacobian * scale / np.sqrt(told)
    values, vectors = np.linalg.eigh(rows.T @ rows + np.eye(len(scale)) / SET.question_widest**2)
    return np.asarray(scale[:, None] * vectors / np.sqrt(values))
