"""Residual checks of a fitted model against what the same checks give on records without anything missing."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from models.identification.finding import Check
from models.identification.fitting.fit import Fit, evaluate
from models.identification.kind import Kind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


def residual_checks(
    kind: Kind, records: Sequence[Record], fit: Fit, likely: Sequence[Theta], seed: int = 0, effects: Sequence[str] = ()
) -> tuple[Check, ...]:
    """Size and whiteness of the residual, with limits from records imitated on models `likely` (values that the fit's
    own uncertainty leaves open) and held against the fit: the largest of one from each; of tables of few numbers, whose
    scatter is wide and whose imitation is quick, the mean of as many such as make `SET.imitated_numbers` numbers.

    Where an effect was found, its form need not be the true one to the last: autocorrelation up to `SET.unseen` is let
    pass, which among many numbers is beyond chance, but a tenth of the noise's power at most.
    """
    criterion = kind.free_run
    rng = np.random.default_rng(seed)
    residual = evaluate(kind, records, fit.theta, criterion)
    actual, rounds = _numbers(residual), max(1, SET.imitated_numbers // (len(residual) * len(likely)))
    largest = []
    for _ in range(rounds):
        imitated = []
        for theta in likely:
            with suppress(ValueError):  # by chance out of what the kind takes: such a record would have been refused
                made = [kind.imitate(record, theta, rng) for record in records]
                imitated.append(_numbers(evaluate(kind, made, fit.theta, criterion)))
        if imitated:
            largest.append(np.max(imitated, axis=0))
    if not largest:
        raise ValueError("records must be such that the fitted model can give their like; it gives none that is read")
    limits = SET.limit_wider * np.mean(largest, axis=0)
    if effects:
        limits[1] = max(limits[1], len(residual) * SET.unseen**2)
    power = "mean square of the residuals in units of the noise; 1 for a right model"
    rho = f"mean of the first {SET.lags} squared autocorrelations of the residuals, times their number (Ljung-Box)"
    words = (("residual_size", "size of the residual", power), ("whiteness", "whiteness", rho))
    return tuple(
        Check(name, title, float(value), float(limit), bool(value <= limit or actual[0] < SET.unseen), meaning)
        for (name, title, meaning), value, limit in zip(words, actual, limits, strict=True)
    )


def chance_error(kind: Kind, records: Sequence[Record], fit: Fit, likely: Sequence[Theta], seed: int = 0) -> float:
    """The largest reported error of `fit` on imitations of `records` on models `likely`; NaN without records."""
    if not records:
        return float("nan")
    rng = np.random.default_rng(seed)
    foreseen = [kind.predict(record, fit.theta) for record in records]
    return max(kind.error([kind.imitate(r, theta, rng) for r in records], foreseen) for theta in likely)


def _numbers(residual: np.ndarray) -> np.ndarray:
    r = residual - residual.mean()
    power = max(float(r @ r), 1e-300)
    lags = range(1, min(SET.lags, len(r) // 2) + 1)
    rho = np.array([float(r[:-lag] @ r[lag:]) / power for lag in lags])
    return np.array([float(residual @ residual) / len(residual), len(r) * float(np.mean(rho**2)) if len(rho) else 0.0])
