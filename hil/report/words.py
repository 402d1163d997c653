"""Words and numbers for readers: names of stages, columns and effects, values with unit, the verdict."""

import math
import re
from collections.abc import Iterator, Sequence
from types import MappingProxyType

import numpy as np

from models.checks.finding import RecordFinding
from models.effects import CATALOGUE, effect_words
from models.files.units import unit_at_end
from models.identification.finding import STAGES, Finding
from models.rigs.kinds import KINDS
from models.words.quantities import amount, number, percent, scale
from models.words.sentences import listed

PARTS = {"train": "training", "holdout": "held out"}  # of the data
_COUNTS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
_MOST_VALUES = 100_000  # that a sentence is worked out from
_WELL_ABOVE = 2.0  # noise floors
_IDS = re.compile(rf"\b(?:{'|'.join(sorted((name for name in CATALOGUE if '_' in name), key=len, reverse=True))})\b")
_SMALL = re.compile(r"(?<![\w.])(\d+\.?\d*(?:e[+-]?\d+)?) (N|m|rad|V|A)(?![\w/·^²]|\s?[mNs]\b)")
_POWER = re.compile(r"(?<![\w.])\d+\.?\d*e[+-]?\d+(?!\w)")
_RANGE = re.compile(r"[\d.]\s*(?:to|and|or|,|…|/)\s*$")
_HYPHEN = re.compile(r"(?<![\w.)\-])-(?=\d)")

_NAMES = MappingProxyType(
    {
        "t": "time",
        "x": "position",
        "v": "speed",
        "a": "acceleration",
        "u": "wall drag",
        "period_index": "number of the period",
        "storage_modulus": "storage modulus G′",
        "loss_modulus": "loss modulus G″",
    }
)


def column_words(column: str) -> tuple[str, str]:
    """Name and unit of a column: `force_N` is ("force", "N"), `v_m_s` is ("speed", "m/s")."""
    stem, unit = unit_at_end(column)
    return _NAMES.get(stem, stem.replace("_", " ")), unit.replace("s2", "s²").replace("deg", "°")


def parameter_words(name: str) -> str:
    """A parameter's name as words: without its unit, a logarithm as what it is the logarithm of."""
    return unit_at_end(name.removeprefix("log10_"))[0].replace("_", " ")


def quantities_words(finding: Finding) -> str:
    """What was measured, as words."""
    return listed(column_words(column)[0] for column in quantity_columns(finding))


def quantity_columns(finding: Finding) -> list[str]:
    """The measured columns of a finding."""
    return re.split(r",\s*|\s+and\s+", finding.quantity)


def error_unit(finding: Finding) -> str:
    """The unit of the reported error: per cent for a relative measure, else the quantity's; "" for a pure number."""
    return "%" if "%" in finding.measure else finding.unit.removeprefix("1")


def error_scale(finding: Finding) -> tuple[float, str]:
    """Factor and unit for all of a finding's errors alike."""
    values = [value for errors in finding.error.values() for value in errors.values() if value is not None]
    return scale(values, error_unit(finding))


def scaled(value: float | None, factor: float) -> float | None:
    """`value` in the prefixed unit."""
    return None if value is None else factor * value


def error_cells(finding: Finding, part: str) -> list[str]:
    """The errors of a part of the data by stage and the noise floor; those of an interpolation are told as such."""
    factor, unit = error_scale(finding)
    errors = finding.error.get(part, {})
    cells = [amount(scaled(v, factor), unit) for v in (*(errors.get(stage) for stage in STAGES), finding.noise_floor)]
    if part == "train" and interpolation(finding):
        cells[1:3] = ["interpolated"] * 2
    return cells


def tidy(text: str) -> str:
    """A sentence of a finding for people: effects by their words, no backticks, small amounts with a prefix, true
    signs.
    """
    words = _IDS.sub(lambda match: effect_words(match.group()), text.replace("`", ""))
    return signed(_prefixed(words))


def signed(text: str) -> str:
    """`text` with a minus in place of the hyphen before a number."""
    return _HYPHEN.sub("−", text)


def _prefixed(text: str) -> str:
    """`text` with its small amounts in a unit with a prefix: all of a unit in the same one."""
    found = [match for match in _SMALL.finditer(text) if not _RANGE.search(text[: match.start()])]
    largest = {unit: max(float(m[1]) for m in found if m[2] == unit) for unit in {m[2] for m in found}}

    def told(match: re.Match[str]) -> str:
        if match.start() not in places:
            return match.group()
        value = float(match[1])
        factor, unit = scale([largest[match[2]] if 1e3 * value > largest[match[2]] else value], match[2])
        if factor == 1.0:
            return match.group()
        digits = len(match[1].partition("e")[0].replace(".", "").lstrip("0"))
        return amount(factor * value, unit, max(digits, 1))

    places = {match.start() for match in found}
    return _POWER.sub(lambda match: number(float(match.group()), 3), _SMALL.sub(told, text))


def effect_summary(effect: str) -> tuple[str, str]:
    """What the catalogue says an effect is, and what would tell it from its confounded effects."""
    declared = CATALOGUE.get(effect)
    return (declared.summary, declared.separated_by) if declared else ("", "")


def grouped(findings: Sequence[RecordFinding]) -> Iterator[list[RecordFinding]]:
    """Findings of one id and severity together, in their order."""
    for name, severity in dict.fromkeys((finding.id, finding.severity) for finding in findings):
        yield [finding for finding in findings if (finding.id, finding.severity) == (name, severity)]


def classes_words(finding: Finding) -> str:
    """The effects that were found, each with those that the records cannot tell from it; nothing where there are
    none.
    """
    return listed(listed(map(effect_words, (effect.id, *effect.equivalent)), "or") for effect in finding.effects)


def headline(finding: Finding) -> str:
    """The verdict as a sentence, which never says more than the records do."""
    names = classes_words(finding)
    open_between = any(effect.equivalent for effect in finding.effects)
    if finding.verdict == "named":
        doubtful = min(finding.effects, key=lambda effect: effect.confidence)
        which = "; these records cannot tell which" if open_between else ""
        return f"What the model lacked: {names}{which}. {doubtful.meaning}".rstrip()
    if interpolation(finding):
        return "As many numbers fitted as means measured: an interpolation, no test of the model."
    if finding.verdict == "none":
        return "Nothing is missing that these records would show: calibration is enough."
    failed = {check.id for check in finding.checks if not check.ok}
    if "information" in failed or any(found.id == "no_response" for found in finding.findings):
        left = "These records cannot tell."
    elif any(name.startswith(("residual_size", "whiteness", "validation")) for name in failed):
        left = "Something structured is left that no known effect explains."
    else:
        left = "The residual is small, but the checks allow no verdict."
    return f"{left} {_for_a_part(finding, names)}" if names else left


def _for_a_part(finding: Finding, names: str) -> str:
    """How much of the calibrated model's error goes with effects that do not explain all of it."""
    errors = finding.error.get(tested_part(finding), {})
    before, after = (errors.get(stage) or math.nan for stage in ("calibrated", "augmented"))
    gone = f": {percent(1 - after / before)} of the error goes with it" if after < before else ""
    return f"A part looks like {names}{gone}."


def interpolation(finding: Finding) -> str:
    """What to say where as many numbers were fitted as the records hold different values to fit; else empty."""
    fitted = sum(e.identifiable or not math.isnan(e.value) for e in finding.calibration.values())
    fitted += sum(len(effect.parameters) for effect in finding.effects)
    last = "augmented" if finding.effects else "calibrated"
    layout = KINDS[finding.kind].layout
    driven = (*(name for names in layout.driven for name in names), *layout.optional)
    shown = [t for t in finding.traces if t.role != "holdout" and last in t.predicted]
    values = [np.atleast_2d(t.predicted[last].T).T for t in shown]
    if not values or not fitted or sum(part.size for part in values) > _MOST_VALUES:
        return ""
    conditions = [
        np.column_stack([part, *(t.signals[name] for name in driven if name in t.signals)])
        for t, part in zip(shown, values, strict=True)
    ]
    means = len(np.unique(np.vstack(conditions), axis=0)) * values[0].shape[1]
    if fitted < means:
        return ""
    return (
        f"{_counted(fitted)} parameters fitted to {_counted(means).lower()} means: an interpolation, so the error on"
        " the training records tells nothing of the model."
    )


def _counted(count: int) -> str:
    return _COUNTS[count] if count < len(_COUNTS) else str(count)


def tested_part(finding: Finding) -> str:
    """The part of the data whose errors tell most: held out where there is any, else training."""
    errors = finding.error.get("holdout", {})
    return "holdout" if any(math.isfinite(v) for v in errors.values() if v is not None) else "train"


def error_story(finding: Finding) -> str:
    """How the error went from the nominal to the last model, in one sentence."""
    part = tested_part(finding)
    if part == "train" and (said := interpolation(finding)):
        return said
    errors = finding.error.get(part, {})
    factor, prefixed = error_scale(finding)
    where = "on records that no fit has seen" if part == "holdout" else "on the training records (none were held out)"
    stages = ["nominal", "calibrated", *(["augmented"] if finding.effects else [])]
    steps = [f"{amount(scaled(errors.get(stage), factor), prefixed)} ({stage})" for stage in stages]
    floor = amount(factor * finding.noise_floor, prefixed)
    floor = f" The noise floor is {floor}." if math.isfinite(finding.noise_floor) else ""
    return f"The error {where} goes from {' to '.join(steps)}.{floor}{_by_chance(finding)}"


def _by_chance(finding: Finding) -> str:
    """Where nothing was added and a held-out error is well above the noise: how much of it chance makes."""
    error = finding.error.get("holdout", {}).get("calibrated") or 0.0
    over = next((check.value for check in finding.checks if check.id == "held_out"), math.nan)
    if finding.effects or not error > _WELL_ABOVE * finding.noise_floor or not over > 0:
        return ""
    factor, prefixed = error_scale(finding)
    return f" Noise and what is uncertain of the parameters make up to {amount(factor * error / over, prefixed)}."
