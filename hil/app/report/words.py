"""Words and numbers as a reader wants them: names of stages, columns and effects, values with unit and prefix, the
verdict.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from types import MappingProxyType

from models.effects import EFFECTS
from models.identification.finding import Finding

STAGE_WORDS = MappingProxyType({"nominal": "nominal", "calibrated": "calibrated", "augmented": "augmented"})
DASH = "–"

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
_UNITS = MappingProxyType(
    {
        "_m_s2": "m/s²",
        "_rad_s2": "rad/s²",
        "_N_m": "N m",
        "_rad_s": "rad/s",
        "_N_per_m": "N/m",
        "_m_s": "m/s",
        "_Pa": "Pa",
        "_Hz": "Hz",
        "_rad": "rad",
        "_deg": "°",
        "_kg": "kg",
        "_N": "N",
        "_A": "A",
        "_V": "V",
        "_m": "m",
        "_s": "s",
    }
)
_PREFIXES = ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))
_PREFIXED = frozenset({"m", "s", "N", "Pa", "A", "V", "m/s"})


def number(value: float | None, digits: int = 4) -> str:
    """A number with a few significant digits; a dash where there is none."""
    if value is None or math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    text = f"{value:.{digits}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        return f"{mantissa}·10^{int(exponent)}".replace("-", "−")
    return text.replace("-", "−")


def scale(values: Iterable[float], unit: str) -> tuple[float, str]:
    """Factor and prefixed unit that bring the largest of `values` between 1 and 1000."""
    largest = max((abs(v) for v in values if math.isfinite(v)), default=0.0)
    if unit not in _PREFIXED or largest == 0:
        return 1.0, unit
    for size, prefix in _PREFIXES:
        if prefix in ("M", "k") and unit in ("s", "m", "m/s"):
            continue
        if largest >= size:
            return 1 / size, prefix + unit
    return 1e6, "µ" + unit


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """A value with its unit, prefixed."""
    if value is None or not math.isfinite(value):
        return number(value)
    factor, prefixed = scale([value], unit)
    return f"{number(factor * value, digits)} {prefixed}" if prefixed not in ("", "1") else number(value, digits)


def column_words(column: str) -> tuple[str, str]:
    """Name and unit of a column: `force_N` is ("force", "N"), `v_m_s` is ("speed", "m/s")."""
    for ending, unit in _UNITS.items():
        if column.endswith(ending):
            stem = column.removesuffix(ending)
            return _NAMES.get(stem, stem.replace("_", " ")), unit
    return _NAMES.get(column, column.replace("_", " ")), ""


def quantities_words(finding: Finding) -> str:
    """What was measured, as words."""
    return listed(column_words(column)[0] for column in quantity_columns(finding))


def quantity_columns(finding: Finding) -> list[str]:
    """The measured columns of a finding."""
    return re.split(r",\s*|\s+and\s+", finding.quantity)


def error_unit(finding: Finding) -> str:
    """The unit of the reported error: per cent where the measure is relative, else the quantity's."""
    return "%" if "%" in finding.measure else finding.unit


def error_scale(finding: Finding) -> tuple[float, str]:
    """Factor and unit for all of a finding's errors alike."""
    values = [value for errors in finding.error.values() for value in errors.values() if value is not None]
    return scale(values, error_unit(finding))


def scaled(value: float | None, factor: float) -> float | None:
    """`value` in the prefixed unit."""
    return None if value is None else factor * value


def effect_words(effect: str) -> str:
    """An effect's id as words."""
    return effect.replace("_", " ")


def effect_summary(effect: str) -> tuple[str, str]:
    """What the catalogue says an effect is, and what would tell it from its confounded effects."""
    declared = next((e for e in EFFECTS if e.id == effect), None)
    return (declared.summary, declared.separated_by) if declared else ("", "")


def listed(words: Iterable[str]) -> str:
    """`a, b and c`."""
    *first, last = list(words) or [""]
    return f"{', '.join(first)} and {last}" if first else last


def headline(finding: Finding) -> str:
    """The verdict as a sentence."""
    names = listed(effect_words(effect.id) for effect in finding.effects)
    if finding.verdict == "named":
        return f"What the model lacked: {names}."
    if finding.verdict == "none":
        return "Nothing is missing: calibration is enough."
    failed = {check.id for check in finding.checks if not check.ok}
    if "information" in failed or any(found.id == "no_response" for found in finding.findings):
        left = "These records cannot tell."
    elif failed & {"residual_size", "whiteness", "validation"}:
        left = "Something structured is left that no known effect explains."
    else:
        left = "What is left is small, but the checks allow no verdict."
    return f"{left} Part of it looks like {names}." if names else left


def tested_part(finding: Finding) -> str:
    """The part of the data whose errors tell most: held out where there is any, else training."""
    errors = finding.error.get("holdout", {})
    return "holdout" if any(math.isfinite(v) for v in errors.values() if v is not None) else "train"


def error_story(finding: Finding) -> str:
    """How the error went from the nominal to the last model, in one sentence."""
    part = tested_part(finding)
    errors = finding.error.get(part, {})
    factor, prefixed = error_scale(finding)
    where = "on records that no fit has seen" if part == "holdout" else "on the training records (none were held out)"
    stages = ["nominal", "calibrated", *(["augmented"] if finding.effects else [])]
    steps = [f"{number(scaled(errors.get(stage), factor), 3)} {prefixed} ({STAGE_WORDS[stage]})" for stage in stages]
    floor = number(factor * finding.noise_floor, 3)
    floor = f" The noise floor is {floor} {prefixed}." if math.isfinite(finding.noise_floor) else ""
    return f"The error {where} goes from {' to '.join(steps)}.{floor}"
