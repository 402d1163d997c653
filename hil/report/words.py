"""Words for readers: names of columns and parameters, errors with their unit, the verdict."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from models.checks.finding import RecordFinding
from models.effects import CATALOGUE, effect_words
from models.files.units import unit_at_end
from models.identification.finding import STAGES, Disagreement, Finding
from models.rigs.kinds import KINDS
from models.words.quantities import amount, number, quantity, scale
from models.words.sentences import Sentences, listed

TEXT: Final = Sentences(__file__)
PARTS: Final = {"train": "training", "holdout": "held out"}  # of the data
SHOWN_SHARE: Final = 0.01  # of the residual that a curve must predict to be mentioned
_WELL_ABOVE: Final = 2.0  # noise floors


def column_words(column: str) -> tuple[str, str]:
    """Name and unit of a column: `force_N` is ("force", "N"), `v_m_s` is ("speed", "m/s")."""
    stem, unit = unit_at_end(column)
    words = TEXT(f"column.{stem}") if f"column.{stem}" in TEXT else stem.replace("_", " ")
    return words, unit.replace("s2", "s²").replace("deg", "°")


def disagreement_words(found: Disagreement) -> str:
    """By what a training record disagrees with the others."""
    effect, _, own = found.by.rpartition(".")
    by = effect_words(own) if own in CATALOGUE else parameter_words(own)
    shift, low, high = (quantity(value, found.unit, 4) for value in (found.shift, *found.ci95))
    by = f"{parameter_words(own)} of {effect_words(effect)}" if effect else by
    said = number(found.standard_deviations, 2)
    return TEXT("disagrees", record=found.record, by=by, shift=shift, low=low, high=high, deviations=said)


def beyond_words(found: Mapping[str, Mapping[str, Sequence[float]]]) -> str:
    """Which signals leave what the records of a model covered, in a sentence."""
    ranges = (f"{_range_words(n, e['reached'])} ({_range_words(n, e['covered'], '')})" for n, e in found.items())
    return TEXT("validity.beyond", signals=ranges)


def covered_words(covered: Mapping[str, Sequence[float]]) -> str:
    return TEXT("validity.covered", signals=(_range_words(*entry) for entry in covered.items()))


def _range_words(column: str, ends: Sequence[float], name: str | None = None) -> str:
    words, unit = column_words(column)
    low, high = (quantity(end, unit) for end in ends)
    return f"{words if name is None else name} {low} to {high}".strip()


def parameter_words(name: str) -> str:
    """A parameter's name as words, without its unit; for a logarithm the name of its argument."""
    return unit_at_end(name.removeprefix("log10_"))[0].replace("_", " ")


def error_scale(finding: Finding) -> tuple[float, str]:
    """Factor and prefixed unit of all errors of a finding."""
    values = [value for errors in finding.error.values() for value in errors.values() if value is not None]
    return scale(values, finding.error_unit)


def error_cells(finding: Finding, part: str) -> list[str]:
    """The errors of a part of the data by stage, and the noise floor; a part without records has neither, and an
    interpolation has no error.
    """
    factor, unit = error_scale(finding)
    errors = finding.error.get(part, {})
    floor = finding.noise_floor if any(value is not None for value in errors.values()) else None
    values = [*(errors.get(stage) for stage in STAGES), floor]
    cells = [amount(None if value is None else factor * value, unit) for value in values]
    if part == "train" and interpolation(finding):
        cells[1:3] = ["interpolated"] * 2
    return cells


def grouped(findings: Sequence[RecordFinding]) -> Iterator[list[RecordFinding]]:
    """Findings of one id and severity together, in their order."""
    for name, severity in dict.fromkeys((finding.id, finding.severity) for finding in findings):
        yield [finding for finding in findings if (finding.id, finding.severity) == (name, severity)]


def classes_words(finding: Finding) -> list[str]:
    """The effects that were found, each with its equivalent effects."""
    return [listed(map(effect_words, (effect.id, *effect.equivalent)), "or") for effect in finding.effects]


def verdict_words(finding: Finding) -> str:
    names = listed(classes_words(finding))
    return f"{finding.verdict}: {names}" if names else finding.verdict


def headline(finding: Finding) -> str:
    names = classes_words(finding)
    if finding.verdict == "named":
        key = "equivalent" if any(effect.equivalent for effect in finding.effects) else "named"
        return TEXT(f"headline.{key}", effects=names)
    if interpolation(finding):
        return TEXT("headline.interpolation")
    if finding.verdict == "none":
        return TEXT("headline.none")
    failed = {check.id for check in finding.checks if not check.ok}
    left = left_words(finding)
    if "information" in failed or any(found.id == "no_response" for found in finding.findings):
        said = [TEXT("headline.not_identifiable"), *([TEXT("headline.also_left", **left)] if left else [])]
    elif any(name.startswith(("residual_size", "whiteness", "validation")) for name in failed):
        said = [TEXT("headline.left", **left) if left else TEXT("headline.structured")]
    else:
        said = [TEXT("headline.small")]
    if names:
        part = tested_part(finding)
        errors = finding.error.get(part, {})
        before, after = (errors.get(stage) or math.nan for stage in ("calibrated", "augmented"))
        before = min(before, finding.constant.get(part, before))  # a base that diverges is no measure
        key = "partly_gone" if after < before else "partly"
        said.append(TEXT(f"headline.{key}", effects=names, share=1 - after / before))
    return " ".join(said)


def confidence_words(finding: Finding) -> str:
    """What the confidence in the least sure effect of a verdict means; empty without a verdict."""
    named = finding.effects if finding.verdict == "named" else ()
    return min(named, key=lambda effect: effect.confidence).meaning if named else ""


def left_words(finding: Finding) -> dict[str, Any]:
    """What is left of the residual, over what variable, and which share that is; empty where no curve predicts any."""
    found = finding.dependence
    best = max(found.curves if found else (), key=lambda curve: curve.share, default=None)
    if found is None or best is None or best.share < SHOWN_SHARE:
        return {}
    term, what = found.term, TEXT("left.curve")
    if term is not None and (term.variable, term.along) == (best.variable, best.along) and term.form != "knots":
        what = TEXT(f"form.{term.form}")
        if term.form == "wave":
            what = TEXT("left.wave", length=quantity(term.numbers["length"].value, term.numbers["length"].unit, 2))
    return {"what": what, "variable": column_words(best.variable)[0], "share": best.share}


def interpolation(finding: Finding) -> str:
    """A sentence where as many numbers were fitted as the records hold different values to fit; else empty."""
    fitted = sum(e.identifiable or not math.isnan(e.value) for e in finding.calibration.values())
    fitted += sum(len(effect.parameters) for effect in finding.effects)
    last = "augmented" if finding.effects else "calibrated"
    layout = KINDS[finding.kind].layout
    driven = (*(name for names in layout.driven for name in names), *layout.optional)
    shown = [t for t in finding.traces if t.role != "holdout" and last in t.predicted]
    values = [np.atleast_2d(t.predicted[last].T).T for t in shown]
    if not values or not fitted or any(len(np.unique(part[:, 0])) > fitted for part in values):
        return ""
    conditions = [
        np.column_stack([part, *(t.signals[name] for name in driven if name in t.signals)])
        for t, part in zip(shown, values, strict=True)
    ]
    means = len(np.unique(np.vstack(conditions), axis=0)) * values[0].shape[1]
    return TEXT("error.interpolation", fitted=fitted, means=means) if fitted >= means else ""


def tested_part(finding: Finding) -> str:
    """The part of the data that tests the models: held out where there is any, else training."""
    errors = finding.error.get("holdout", {})
    return "holdout" if any(math.isfinite(v) for v in errors.values() if v is not None) else "train"


def error_words(finding: Finding) -> str:
    """The error from the nominal to the last model, and the noise floor."""
    part = tested_part(finding)
    if part == "train" and (said := interpolation(finding)):
        return said
    *cells, floor = error_cells(finding, part)
    stages = STAGES if finding.effects else STAGES[:-1]
    steps = " to ".join(f"{cell} ({stage})" for cell, stage in zip(cells, stages, strict=False))
    said = TEXT(f"error.{part}", steps=steps)
    if math.isfinite(finding.noise_floor):
        said += " " + TEXT("error.floor", floor=floor)
    error = finding.error.get("holdout", {}).get("calibrated") or 0.0
    passed = any(check.id == "held_out" and check.ok for check in finding.checks)
    if not finding.effects and error > _WELL_ABOVE * finding.noise_floor and passed:
        said += " " + TEXT("error.chance")
    return said
