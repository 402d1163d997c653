"""The null distribution of a verdict's checks: what the same fits leave of records that the found model made itself."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass

import numpy as np

from models.identification.fitting.fit import axes, evaluate, judged_cost, mean_squares
from models.identification.fitting.fitter import Fitter
from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class Left:
    """What a fit leaves of a measured column, in units of the noise: mean square and rms autocorrelation of its
    residuals, validation cost (of all columns, with the first), mean square of the residuals on held-out records, not a
    number without any. A field is the id of a check. Mean squares are those of the middle one of forty stretches: a
    slip event out of step is no wrong law.
    """

    residual_size: float
    whiteness: float
    validation: float
    held_out: float


def left_by(
    kind: Kind, train: Sequence[Record], holdout: Sequence[Record], theta: Theta, validation: float, criterion: int
) -> tuple[Left, ...]:
    """What the fit `theta` to `train` leaves of each measured column under a `criterion`; `validation` is known."""
    found = list[Left]()
    for one in map(kind.alone, kind.channels):
        residual = evaluate(one, train, theta, criterion)
        held = _size(evaluate(one, holdout, theta, criterion)) if holdout else np.nan
        found.append(Left(_size(residual), _autocorrelation(residual), np.nan if found else validation, held))
    return tuple(found)


def rehearsed(
    kind: Kind,
    train: Sequence[Record],
    holdout: Sequence[Record],
    theta: Theta,
    effects: Sequence[str],
    rng: np.random.Generator,
) -> Iterator[tuple[Left, ...]]:
    """What fits leave of each column of imitations of the records by the model at `theta` with `effects`: up to
    `SET.rehearsals` times more and more, the most so far. The training parts of the splits are fitted from close by,
    where fits end: from numbers off by `SET.numerics`. Raises ValueError where no imitation can be read.
    """
    splits = kind.splits(kind.searched(train))

    def imitated(records: Sequence[Record]) -> list[Record]:
        return [kind.imitate(record, theta, rng) for record in records]

    rows = []
    for _ in range(SET.rehearsals):
        with suppress(ValueError):  # outside what the kind accepts, by chance: such a record would be refused
            parts = []
            for part, held in splits:
                made, kept, unseen = imitated(part), imitated(held), imitated(holdout)
                fit = Fitter.of(kind, made, effects).near(_off(kind, effects, theta, rng)).theta
                left = left_by(kind, made, unseen, fit, judged_cost(kind, kept, fit), kind.free_run)
                parts.append([*map(astuple, left)])
            most, mean = np.max(parts, axis=0), np.mean(parts, axis=0)
            most[:, 2] = mean[:, 2]  # the validation cost
            rows.append(most)
            yield tuple(Left(*row) for row in np.max(rows, axis=0).tolist())
    if not rows:
        raise ValueError("records must be such that the fitted model can imitate them; it gives none that can be read")


def _off(kind: Kind, effects: Sequence[str], theta: Theta, rng: np.random.Generator) -> Theta:
    """`theta` with each fitted number off by what numerics leave open, up or down."""
    fitted = [axis.parameter for axis in axes(kind, effects)]
    signs = SET.numerics * rng.choice((-1, 1), len(fitted))
    moved = ((p, theta[p.key] * (1 + sign)) for p, sign in zip(fitted, signs, strict=True))
    return theta | {p.key: float(np.clip(value, p.lower, p.upper)) for p, value in moved}


def _size(residual: Array) -> float:
    return float(np.median(mean_squares(residual, SET.stretch)))


def _autocorrelation(residual: Array) -> float:
    """Rms of the first autocorrelations."""
    r = residual - residual.mean()
    power = max(float(r @ r), 1e-300)
    rho = [float(r[:-lag] @ r[lag:]) / power for lag in range(1, min(SET.lags, len(r) // 2) + 1)]
    return float(np.sqrt(np.mean(np.square(rho)))) if rho else 0.0
