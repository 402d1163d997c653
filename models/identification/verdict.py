"""One rule for every verdict: `named` and `none` only where every check of the report passes; else `unknown`."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np
import scipy

from models.checks.finding import RecordFinding
from models.identification.finding import STAGES, Check, Fitted
from models.identification.fitting.confidence import near
from models.identification.fitting.fit import Fit, axes
from models.identification.kind import Kind
from models.identification.search.forward_selection import Search
from models.identification.settings import SET
from models.parameter import Name
from models.records.record import Record
from models.theta import spelled
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


def verdict_of(effects: Sequence[str], checks: Sequence[Check]) -> str:
    """`unknown` where a check fails; else `named` where there are effects and `none` where there are none."""
    if not all(check.ok for check in checks):
        return "unknown"
    return "named" if effects else "none"


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
    """What beside the residual's size and whiteness a verdict rests on: validation, parameters, held-out records, the
    records themselves.

    `chance` is the held-out error that imitated records give (not a number: none held out); within it, the fit to
    all records is validated by those held out. `allowed` is the mean square that the told uncertainty of the
    parameters allows of a fit's own residuals. Fitted to a share q of the records, parameters are uncertain by
    1/sqrt(q) as much, so records left out may exceed 1 by 1/q times as much. The mean square of few residuals
    scatters as chi-square has it, which is allowed, too. `longest_s` is how long the longest record lasts.
    """
    return tuple(
        Check(name, title, float(value), float(limit), bool(value <= limit), meaning)
        for name, title, value, limit, meaning in (
            _validation(found, held_out, allowed, chance),
            _within_bounds(kind, found),
            *(
                _of_effects(kind, found, spread, held_out, longest_s)
                if found.effects
                else _of_none(findings, held_out, chance)
            ),
            *_information(spread),
        )
    )


_Row = tuple[str, str, float, float, str]
"""A check's id, its name for people, value, limit and meaning."""


def _validation(found: Search, held_out: Mapping[str, float], allowed: float, chance: float) -> _Row:
    limit = SET.clean * (max(found.null_cost, found.sensitivity) if found.effects else min(found.null_cost, SET.near))
    if found.effects:
        limit = max(limit, 1 + (allowed - 1) / found.trained_share)
    limit = max(limit, float(scipy.stats.chi2.ppf(SET.chance_level, found.augmented.count)) / found.augmented.count)
    left, of = found.after, "mean square on records left out of the fits"
    if found.augmented.chi2 < left and not found.effects:
        left, of = found.augmented.chi2, f"{of}, or of the fit to all, which without an effect has nothing to overfit"
    elif found.augmented.chi2 < left and by_chance(held_out.get("augmented", np.nan), chance):
        left, of = found.augmented.chi2, f"{of}, or of the fit to all, which errs on records never used as chance does"
    return "validation", "validation cost", left, limit, of


def _within_bounds(kind: Kind, found: Search) -> _Row:
    count = len(at_bounds(kind, found.augmented, found.effects))
    meaning = "a parameter of the base or of an effect that is at its bound would have gone further"
    return "bounds", "parameters at their bounds", count, 0, meaning


def _of_effects(
    kind: Kind, found: Search, spread: Mapping[Name, Fitted], held_out: Mapping[str, float], longest_s: float
) -> Iterator[_Row]:
    amplitudes = [(name, kind.declared(name).amplitude().name) for name in found.effects]
    untold = sum(name not in spread or not spread[name].told for name in amplitudes)
    yield "effects_told", "effects whose size is not identifiable", untold, 0, "its 95 % interval is as wide as itself"
    waves = [(name, p.name) for name in found.effects for p in kind.declared(name).parameters() if p.unit == "Hz"]
    if waves:
        longest = max(1 / found.augmented.theta[name] for name in waves) / longest_s
        meaning = "what does not come back within a record may be any slow change"
        yield "periods", "period of an effect over the longest record", longest, 1 / SET.seen_again, meaning
    if held_out:
        share = held_out["augmented"] / max(min(held_out["calibrated"], held_out["nominal"]), 1e-300)
        yield "held_out", "held-out error, augmented over the better without", share, 1, "of records never used before"


def _of_none(findings: Sequence[RecordFinding], held_out: Mapping[str, float], chance: float) -> Iterator[_Row]:
    weak = sum(finding.severity == "weakens" for finding in findings)
    yield "records", "findings that weaken a verdict", weak, 0, "see the findings on the records"
    if np.isfinite(chance):
        over = held_out["calibrated"] / max(chance, 1e-300)
        meaning = "of the free run, by the most that noise and uncertain parameters make of it"
        yield "held_out", "held-out error over chance", over, SET.beyond_chance, meaning


def _information(spread: Mapping[Name, Fitted]) -> Iterator[_Row]:
    base = [estimate.told for name, estimate in spread.items() if isinstance(name, str)]
    if base:
        share = float(np.mean([not told for told in base]))
        title = "share of calibrated parameters that are not identifiable"
        yield "information", title, share, 0.99, "1: these records cannot tell"


WORSE: Final = "worse_on_held_out_records"
"""Id of the finding on a stage of the model that errs more on held-out records than one before it."""


def setbacks(error: Mapping[str, float], floor: float) -> dict[str, str]:
    """A sentence for each stage whose held-out `error` is clearly above an earlier one's and the noise `floor`."""
    said: dict[str, str] = {}
    known = [stage for stage in STAGES if np.isfinite(error.get(stage, np.nan))]
    for place, stage in enumerate(known):
        better = min(known[:place], key=lambda name: error[name], default=stage)
        least = SET.near_floor * floor if np.isfinite(floor) else 0.0
        if error[stage] > max(SET.clearly_worse * error[better], least):
            said[stage] = TEXT("worse", stage=stage, better=better, error=error[stage], least=error[better])
    return said


def by_chance(error: float, chance: float) -> bool:
    """Whether noise and uncertain parameters alone give such a held-out `error`, by a slip missed, say."""
    return bool(error <= SET.beyond_chance * chance)


def setback_findings(
    said: Mapping[str, str], holdout: Sequence[Record], bounds: Sequence[str], weakened: str | None
) -> tuple[RecordFinding, ...]:
    """`setbacks` as findings that head a report; `bounds` are the parameters that ran to theirs. Only that of the stage
    `weakened` weakens the verdict: the last one's, where it errs beyond chance.
    """
    at = TEXT("at_bounds", parameters=bounds) if bounds else ""
    return tuple(
        RecordFinding(
            WORSE,
            "weakens" if stage == weakened else "note",
            ", ".join(record.name for record in holdout),
            f"stage [{stage}] of model.toml",
            f"{sentence}{at}",
            "error of the free-running prediction of records that no fit has seen",
            "state how well the nominal values are known as [prior] NAME_std = ... in the rig file, record more, or use"
            " the better stage (--stage)",
        )
        for stage, sentence in said.items()
    )


def at_bounds(kind: Kind, fit: Fit, effects: Sequence[str]) -> list[str]:
    """Names of the fitted parameters at a bound. A bound of 0, where the law itself ends or becomes a simpler one, is
    none, but for the size of an effect, which is not there then; nor is one where a form is as it is declared.
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
