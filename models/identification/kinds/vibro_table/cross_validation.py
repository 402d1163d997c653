"""Cross-validation of a table of mean speeds over whole conditions: what each effect is worth on runs that no fit
saw.
"""

from collections.abc import Sequence

import numpy as np

from models.identification.fitting.fit import Problem, descend
from models.identification.kinds.vibro_table.vibro_table import VibroTableKind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


def cross_validated(kind: VibroTableKind, theta: Theta, records: Sequence[Record]) -> dict[str, float]:
    """Rms error in m/s over conditions, each predicted by a fit to the parts (`kind.folds`) that do not hold it.

    Keys: "" for the model with every effect of `theta`, and each effect's id for the model refitted without it. Every
    fit starts from `theta`; which effects there are is not chosen anew in each part. Empty where there are fewer than
    24 conditions.
    """
    splits = kind.splits(records)
    if sum(len(_pairs(held)) for _, held in splits) < SET.table_fewest:
        return {}
    out = {}
    for left_out in ("", *theta.effects):
        start = theta.without(left_out)
        secants = (0.3, 0.1) if left_out else (0.1,)
        squares = [_squared(kind, held, _fitted(kind, training, start, secants)) for training, held in splits]
        out[left_out] = float(np.sqrt(np.mean(np.concatenate(squares))))
    return out


def _fitted(kind: VibroTableKind, records: Sequence[Record], theta: Theta, secants: Sequence[float]) -> Theta:
    for secant in secants:
        theta = descend(Problem.of(kind, records, list(theta.effects), 0), theta, secant, SET.table_steps).theta
    return theta


def _pairs(records: Sequence[Record]) -> set[tuple[float, float]]:
    return {(float(p), float(d)) for r in records for p, d in zip(r["period_s"], r["duty"], strict=True)}


def _squared(kind: VibroTableKind, held: Sequence[Record], theta: Theta) -> np.ndarray:
    """Squared errors of the conditions of `held`."""
    return np.concatenate([kind.errors(r, kind.predict(r, theta)) ** 2 for r in held])
