"""One rule for every verdict: `named` and `none` only where every check of the report passes; else `unknown`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.usable import lead_in_s
from models.identification.finding import STAGES, Check, Fitted
from models.identification.fitting.fit import Fit, axes, judged_cost
from models.identification.fitting.horizon import prefixes
from models.identification.intervals import gain_beyond, near
from models.identification.kind import Kind
from models.identification.rehearsal import Left, left_by, rehearsed
from models.identification.search.search import Search
from models.identification.settings import SET
from models.identification.thinning import signals_of
from models.parameter import Name, Parameter
from models.records.record import Record
from models.rigs.columns import TIME
from models.theta import Theta, spelled
from models.words.sentences import Quantity, Sentences
from models.workers import each

TEXT: Final = Sentences(__file__)
_PLACES: Final = ("position_m", "angle_rad")


def verdict_of(effects: Sequence[str], checks: Sequence[Check]) -> str:
    """`unknown` where a check fails; else `named` where there are effects and `none` where there are none."""
    if not all(check.ok for check in checks):
        return "unknown"
    return "named" if effects else "none"


def _check(name: str, value: float, limit: float, column: str = "") -> Check:
    """The check `name` with its texts, of a further measured `column` where one is named."""
    said, meaning = (TEXT(f"check.{name}.{key}", lags=SET.lags, stretches=SET.blocks) for key in ("name", "meaning"))
    said, name = (f"{said}, {column}", f"{name}.{column}") if column else (said, name)
    return Check(name, said, float(value), float(limit), bool(value <= limit), meaning)


def unexplained(kind: Kind, found: Search, others: Sequence[Record]) -> tuple[list[Record], list[Check]]:
    """The worst of the unseen `others` that the model does not explain, and the check that it explains all."""
    if not others:
        return [], []
    seen = [prefixes(kind.searched([record]), found.horizon_s) for record in others]
    costs = each(lambda part: judged_cost(kind, part, found.augmented.theta), seen)
    check = _check("outside", max(costs), SET.clean * max(found.after, 1.0))
    worst = np.argsort(costs, kind="stable")[::-1][: SET.joined]
    return [others[k] for k in worst if costs[k] > check.limit], [check]


def checks_of_rest(
    kind: Kind, found: Search, train: Sequence[Record], holdout: Sequence[Record], rng: np.random.Generator
) -> tuple[Check, ...]:
    """What the found model leaves of the records, beside the most that fits leave of records that it made itself, as
    many as it takes to pass. Where held-out records pass and a fit to a part may miss one more slip event, or where
    nothing was found, the fit to all records may validate itself. Where nothing was found, fits that miss their own
    records by far show nothing. The form of an effect may miss 1 % of the power that it explains, at most twice the
    noise's.
    """
    form = SET.unseen
    if found.effects:
        form = float(np.clip(SET.form_left * found.calibrated.chi2, form, SET.form_most))
    theta, whole = found.augmented.theta, found.augmented.chi2
    first, *further = left_by(kind, train, holdout, theta, found.after, kind.final)
    names, checks = ("", *kind.channels[1:]), tuple[Check, ...]()
    for null, *nulls in rehearsed(kind, train, holdout, theta, found.model, rng):
        if not found.effects:
            null = replace(null, validation=min(null.validation, SET.near))

        def compared(left: Left, nulls: Sequence[Left] = (null, *nulls)) -> tuple[Check, ...]:
            rows = zip((left, *further), nulls, names, strict=True)
            return tuple(check for left, null, name in rows for check in within(left, null, form, name))

        unseen = [check.ok for check in compared(first) if check.id.startswith("held_out")]
        itself = all(unseen) and (not found.effects or bool(unseen and kind.beginnings_s))
        checks = compared(replace(first, validation=min(found.after, whole)) if itself else first)
        if all(check.ok for check in checks):
            break
    return checks


def within(left: Left, null: Left, form: float = SET.unseen, column: str = "") -> tuple[Check, ...]:
    """Whether a model that is `left` with so much is within 1.5 times `null`, the most that fits leave of records that
    it made, and what the `form` of its law may miss, a share of the noise's power: of autocorrelations the squares add.
    Residuals far below the noise have no structure that counts.
    """
    limits = {name: SET.clean * most + form for name, most in asdict(null).items()}
    white = float(np.hypot(SET.clean * null.whiteness, form / (1 + form)))
    limits["whiteness"] = white if left.residual_size >= SET.unseen else 1.0
    return tuple(_check(name, v, limits[name], column) for name, v in asdict(left).items() if np.isfinite(v))


def checks_of_model(
    kind: Kind,
    found: Search,
    spread: Mapping[Name, Fitted],
    held_out: Mapping[str, float],
    findings: Sequence[RecordFinding],
    periods: Mapping[Name, float] = MappingProxyType({}),
) -> tuple[Check, ...]:
    """What a verdict rests on beside what is left: parameters, held-out errors, findings, the effects' `periods`."""
    checks = [_check("bounds", len(at_bounds(kind, found.augmented, found.effects, found.refinements)), 0)]
    if not found.effects:
        checks.append(_check("records", sum(finding.severity == "weakens" for finding in findings), 0))
        gain = max((trial.gain for *_, trials in found.rounds for trial in trials), default=0.0)
        checks.append(_check("candidate", max(gain, 0.0), SET.doubted * found.threshold))
    else:
        sizes = [spread.get((name, kind.declared(name).amplitude().name)) for name in found.effects]
        checks.append(_check("effects_told", sum(size is None or not size.identifiable for size in sizes), 0))
        if periods:
            checks.append(_check("periods", max(periods.values()), 1 / SET.seen_again))
        if held_out:
            share = held_out["augmented"] / max(min(held_out["calibrated"], held_out["nominal"]), 1e-300)
            checks.append(_check("held_out_gain", share, 1))
    if vague := [not estimate.identifiable for name, estimate in spread.items() if isinstance(name, str)]:
        checks.append(_check("information", float(np.mean(vague)), 0.99))
    return tuple(checks)


def periods_of(kind: Kind, effects: Sequence[str], theta: Theta, records: Sequence[Record]) -> dict[Name, float]:
    """The periods of `effects` at `theta` over the longest record, wavelengths over the longest way without gap."""
    found = dict[Name, float]()
    for p, name in _parameters(kind, effects):
        if p.unit == "Hz":
            found[name] = 1 / theta[name] / _longest_s(records)
        elif p.name.startswith("wavelength"):
            found[name] = theta[name] / _way(records)
    return found


def unshown(
    kind: Kind, effects: Sequence[str], theta: Theta, records: Sequence[Record]
) -> dict[Name, tuple[float, float]]:
    """Parameters of the `effects` at `theta` whose range the `records` do not cover, and what they leave open: periods
    that they do not repeat, time constants beyond the longest, lengths beyond the longest path, places off the way.
    The number of records does not enter.
    """
    open_, long = dict[Name, tuple[float, float]](), periods_of(kind, effects, theta, records)
    for p, name in _parameters(kind, effects):
        value, places = theta.get(name, p.value), "places" in kind.declared(name[0]).needs
        if name in long:
            reached = long[name] > 1 / SET.seen_again
            least = value / (SET.seen_again * long[name])  # the longest period that is repeated
            ends = (p.lower, SET.seen_again * value * long[name]) if p.unit == "Hz" else (least, p.upper)
        elif p.role == "place":
            low, high = min(map(np.min, _places(records))), max(map(np.max, _places(records)))
            reached, ends = not low <= value <= high, (p.lower, low) if value < low else (high, p.upper)
        else:
            covered = _longest_s(records) if p.unit == "s" else _path(records) if places and p.unit == "m" else np.inf
            reached, ends = value > covered, (covered, p.upper)
        if reached:
            open_[name] = ends
    return open_


def _parameters(kind: Kind, effects: Sequence[str]) -> Iterator[tuple[Parameter, tuple[str, str]]]:
    return ((p, (effect, p.name)) for effect in effects for p in kind.declared(effect).parameters())


def _longest_s(records: Sequence[Record]) -> float:
    """The longest record, inf where none is a time series."""
    return max((float(np.ptp(r[TIME])) - lead_in_s(r) for r in records if r.layout.time), default=np.inf)


def _places(records: Sequence[Record]) -> list[np.ndarray]:
    return [r[column] for r in records for column in _PLACES if column in r.columns]


def _way(records: Sequence[Record]) -> float:
    """The longest stretch of places without a gap between the records, inf where none has places."""
    longest, low, high = 0.0 if _places(records) else np.inf, np.inf, -np.inf
    for least, most in sorted((float(x.min()), float(x.max())) for x in _places(records)):
        low, high = (low, max(high, most)) if least <= high else (least, most)
        longest = max(longest, high - low)
    return longest


def _path(records: Sequence[Record]) -> float:
    """The longest path of a record, from means over 0.1 s: noise moves nothing."""
    rates = (own[f"{name} rate"] for own in map(signals_of, records) for name in _PLACES if f"{name} rate" in own)
    paths = [np.abs(rate).sum() for rate in rates]
    return float(max(paths, default=np.inf))


WORSE: Final = "worse_on_held_out_records"
"""Id of the finding on a stage of the model that errs more on held-out records than one before it."""


def setbacks(error: Mapping[str, float], floor: float, unit: str = "1") -> dict[str, str]:
    """A sentence for each stage whose held-out `error` is clearly above an earlier one's and the noise `floor`."""
    said: dict[str, str] = {}
    known = [stage for stage in STAGES if np.isfinite(error.get(stage, np.nan))]
    for number, stage in enumerate(known):
        better = min(known[:number], key=lambda name: error[name], default=stage)
        floors = SET.near_floor * floor if np.isfinite(floor) else 0.0
        if error[stage] > max(SET.clearly_worse * error[better], floors):
            own, least = Quantity(error[stage], unit), Quantity(error[better], unit)
            said[stage] = TEXT("worse.sentence", stage=stage, better=better, error=own, least=least)
    return said


def setback_findings(
    said: Mapping[str, str], holdout: Sequence[Record], bounds: Mapping[str, Sequence[str]], weakened: str | None
) -> tuple[RecordFinding, ...]:
    """`setbacks` as findings that head a report; `bounds` are each stage's parameters that ran to theirs. Only that of
    the stage `weakened` weakens the verdict: the last one's, where it errs beyond chance.
    """
    at = {stage: f" {TEXT('worse.bounds', parameters=own, n=len(own))}" for stage, own in bounds.items() if own}
    files, how, remedy = ", ".join(record.name for record in holdout), TEXT("worse.how"), TEXT("worse.remedy")
    return tuple(
        RecordFinding(
            WORSE,
            "weakens" if stage == weakened else "note",
            files,
            TEXT("worse.where", stage=stage),
            sentence + at.get(stage, ""),
            how,
            remedy,
        )
        for stage, sentence in said.items()
    )


def at_bounds(kind: Kind, fit: Fit, effects: Sequence[str], refinements: Sequence[str] = ()) -> list[str]:
    """Names of the fitted parameters at a bound. A bound of 0, where a law ends or becomes a simpler one, does not
    count, except for the size of an effect, which is then absent; nor does a bound that is the declared value of a
    form, nor that of one of the `refinements` beyond which the fit gains less than a refinement must.
    """
    sizes = {(name, kind.declared(name).amplitude().name) for name in effects}
    found = []
    for k, axis in enumerate(axes(kind, [*effects, *refinements])):
        p = axis.parameter
        plain = {0.0, p.value} if p.effect else {0.0}
        bounds = [bound for bound in (p.lower, p.upper) if axis.name in sizes or bound not in plain]
        if p.effect in refinements and gain_beyond(fit, k) < SET.finer_gain:
            continue
        if any(near(fit.theta[axis.name], bound, p) for bound in bounds):
            found.append(spelled(axis.name))
    return found
