"""One rule for every verdict: `named` and `none` only where every check of the report passes; else `unknown`."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np
import scipy

from models.checks.finding import RecordFinding
from models.identification.finding import STAGES, Check, Fitted
from models.identification.fitting.confidence import near
from models.identification.fitting.fit import Fit, axes, evaluate
from models.identification.kind import Kind
from models.identification.search.search import Search
from models.identification.settings import SET
from models.parameter import Name
from models.records.record import Record
from models.theta import Theta, spelled
from models.words.sentences import Quantity, Sentences

TEXT: Final = Sentences(__file__)


def verdict_of(effects: Sequence[str], checks: Sequence[Check]) -> str:
    """`unknown` where a check fails; else `named` where there are effects and `none` where there are none."""
    if not all(check.ok for check in checks):
        return "unknown"
    return "named" if effects else "none"


def _check(name: str, value: float, limit: float, title: str = "name", meaning: str = "meaning") -> Check:
    """The check `name` with two of its texts."""
    words = (TEXT(f"check.{name}.{key}", lags=SET.lags) for key in (title, meaning))
    return Check(name, next(words), float(value), float(limit), bool(value <= limit), next(words))


def residual_checks(
    kind: Kind, records: Sequence[Record], fit: Fit, likely: Sequence[Theta], seed: int = 0, effects: Sequence[str] = ()
) -> tuple[Check, ...]:
    """Size and whiteness of the residual, with limits from records imitated on models `likely` (values that the fit's
    own uncertainty allows) and compared with the fit: the largest of one from each. Tables of few numbers scatter
    widely and are quick to imitate: there it is the mean of as many such maxima as make `SET.imitated_numbers` numbers.

    The form of an effect that was found need not be exact: autocorrelation up to `SET.unseen` passes. Among many
    numbers that is beyond chance, but at most a tenth of the noise's power.
    """
    criterion = kind.free_run
    rng = np.random.default_rng(seed)
    residual = evaluate(kind, records, fit.theta, criterion)
    actual, rounds = _numbers(residual), max(1, SET.imitated_numbers // (len(residual) * len(likely)))
    largest = []
    for _ in range(rounds):
        imitated = []
        for theta in likely:
            with suppress(ValueError):  # outside what the kind accepts, by chance: such a record would be refused
                made = [kind.imitate(record, theta, rng) for record in records]
                imitated.append(_numbers(evaluate(kind, made, fit.theta, criterion)))
        if imitated:
            largest.append(np.max(imitated, axis=0))
    if not largest:
        raise ValueError("records must be such that the fitted model can imitate them; it gives none that can be read")
    limits = SET.limit_wider * np.mean(largest, axis=0)
    if effects:
        limits[1] = max(limits[1], len(residual) * SET.unseen**2)
    checks = map(_check, ("residual_size", "whiteness"), actual, limits)
    return tuple(replace(check, ok=check.ok or bool(actual[0] < SET.unseen)) for check in checks)


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


def model_checks(
    kind: Kind,
    found: Search,
    spread: Mapping[Name, Fitted],
    held_out: Mapping[str, float],
    findings: Sequence[RecordFinding],
    allowed: float = 0.0,
    chance: float = np.nan,
    longest_s: float = np.inf,
) -> tuple[Check, ...]:
    """What a verdict rests on beside the residual's size and whiteness: validation, parameters, held-out records and
    the findings on the records.

    `chance` is the held-out error that imitated records give (not a number: none held out). A fit to all records whose
    held-out error is within it counts as validated. `allowed` is the mean square of the residuals that noise in the
    parameters allows. A fit to a share q of the records has parameters 1/sqrt(q) times as uncertain, so the records
    left out may exceed 1 by 1/q times as much. Few residuals scatter as chi-square does, which is allowed, too.
    `longest_s` is the length of the longest record.
    """
    at_bound = _check("bounds", len(at_bounds(kind, found.augmented, found.effects)), 0)
    if found.effects:
        own = _of_effects(kind, found, spread, held_out, longest_s)
    else:
        own = _of_none(findings, held_out, chance)
    return (_validation(found, held_out, allowed, chance), at_bound, *own, *_information(spread))


def _validation(found: Search, held_out: Mapping[str, float], allowed: float, chance: float) -> Check:
    limit = SET.clean * (max(found.null_cost, found.sensitivity) if found.effects else min(found.null_cost, SET.near))
    if found.effects:
        limit = max(limit, 1 + (allowed - 1) / found.trained_share)
    limit = max(limit, float(scipy.stats.chi2.ppf(SET.chance_level, found.augmented.count)) / found.augmented.count)
    whole = found.augmented.chi2
    if whole < found.after and not found.effects:
        return _check("validation", whole, limit, meaning="whole")
    if whole < found.after and by_chance(held_out.get("augmented", np.nan), chance):
        return _check("validation", whole, limit, meaning="chance")
    return _check("validation", found.after, limit)


def _of_effects(
    kind: Kind, found: Search, spread: Mapping[Name, Fitted], held_out: Mapping[str, float], longest_s: float
) -> Iterator[Check]:
    sizes = [spread.get((name, kind.declared(name).amplitude().name)) for name in found.effects]
    yield _check("effects_told", sum(size is None or not size.identifiable for size in sizes), 0)
    waves = [(name, p.name) for name in found.effects for p in kind.declared(name).parameters() if p.unit == "Hz"]
    if waves:
        longest = max(1 / found.augmented.theta[name] for name in waves) / longest_s
        yield _check("periods", longest, 1 / SET.seen_again)
    if held_out:
        share = held_out["augmented"] / max(min(held_out["calibrated"], held_out["nominal"]), 1e-300)
        yield _check("held_out", share, 1)


def _of_none(findings: Sequence[RecordFinding], held_out: Mapping[str, float], chance: float) -> Iterator[Check]:
    yield _check("records", sum(finding.severity == "weakens" for finding in findings), 0)
    if np.isfinite(chance):
        over = held_out["calibrated"] / max(chance, 1e-300)
        yield _check("held_out", over, SET.beyond_chance, "name_of_none", "meaning_of_none")


def _information(spread: Mapping[Name, Fitted]) -> Iterator[Check]:
    vague = [not estimate.identifiable for name, estimate in spread.items() if isinstance(name, str)]
    if vague:
        yield _check("information", float(np.mean(vague)), 0.99)


WORSE: Final = "worse_on_held_out_records"
"""Id of the finding on a stage of the model that errs more on held-out records than one before it."""


def setbacks(error: Mapping[str, float], floor: float, unit: str = "1") -> dict[str, str]:
    """A sentence for each stage whose held-out `error` in `unit` is clearly above an earlier one's and the noise
    `floor`.
    """
    said: dict[str, str] = {}
    known = [stage for stage in STAGES if np.isfinite(error.get(stage, np.nan))]
    for number, stage in enumerate(known):
        better = min(known[:number], key=lambda name: error[name], default=stage)
        floors = SET.near_floor * floor if np.isfinite(floor) else 0.0
        if error[stage] > max(SET.clearly_worse * error[better], floors):
            own, least = Quantity(error[stage], unit), Quantity(error[better], unit)
            said[stage] = TEXT("worse.sentence", stage=stage, better=better, error=own, least=least)
    return said


def by_chance(error: float, chance: float) -> bool:
    """Whether noise and uncertain parameters alone give such a held-out `error`, for instance by a missed slip."""
    return bool(error <= SET.beyond_chance * chance)


def setback_findings(
    said: Mapping[str, str], holdout: Sequence[Record], bounds: Sequence[str], weakened: str | None
) -> tuple[RecordFinding, ...]:
    """`setbacks` as findings that head a report; `bounds` are the parameters that ran to theirs. Only that of the stage
    `weakened` weakens the verdict: the last one's, where it errs beyond chance.
    """
    at = f" {TEXT('worse.bounds', parameters=bounds, n=len(bounds))}" if bounds else ""
    files, how, remedy = ", ".join(record.name for record in holdout), TEXT("worse.how"), TEXT("worse.remedy")
    return tuple(
        RecordFinding(
            WORSE,
            "weakens" if stage == weakened else "note",
            files,
            TEXT("worse.where", stage=stage),
            f"{sentence}{at}",
            how,
            remedy,
        )
        for stage, sentence in said.items()
    )


def at_bounds(kind: Kind, fit: Fit, effects: Sequence[str]) -> list[str]:
    """Names of the fitted parameters at a bound. A bound of 0, where a law ends or becomes a simpler one, does not
    count, except for the size of an effect, which is then absent; nor does a bound that is the declared value of a
    form.
    """
    sizes = {(name, kind.declared(name).amplitude().name) for name in effects}
    found = []
    for axis in axes(kind, effects):
        p = axis.parameter
        plain = {0.0, p.value} if p.effect else {0.0}
        bounds = [bound for bound in (p.lower, p.upper) if axis.name in sizes or bound not in plain]
        if any(near(fit.theta[axis.name], bound, p) for bound in bounds):
            found.append(spelled(axis.name))
    return found
