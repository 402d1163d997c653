"""What the tables of a report hold: errors, parameters with their intervals, records, the smallest effects."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.report.mathml import symbol_html
from hil.report.words import PARTS, error_cells, interpolation, parameter_words, scaled
from models.effects import effect_words
from models.identification.finding import Check, Finding, Fitted
from models.parameter import LETTERS
from models.words.quantities import DASH, change, number, percent, quantity, scale, told

_LOG = "log10_"


def error_rows(finding: Finding) -> list[list[str]]:
    """Errors by part and stage, and how much of the nominal error is gone."""
    rows = []
    for part, words in PARTS.items():
        errors = finding.error.get(part, {})
        first, last = errors.get("nominal", math.nan), errors.get("augmented", math.nan)
        compared = first and math.isfinite(first) and math.isfinite(last)
        compared = compared and not (part == "train" and interpolation(finding))
        *shown, floor = error_cells(finding, part)
        rows.append([words, *shown, percent(1 - last / first) if compared else DASH, floor])
    return rows


def parameters(
    estimates: Mapping[str, Fitted],
    nominal: Mapping[str, float] | None = None,
    symbols: Mapping[str, str] = LETTERS,
) -> dict[str, Any]:
    """Parameters with their 95 % intervals; against the nominal values where there are any. A logarithm is shown as
    what it is the logarithm of, one unit has one prefix in all rows.
    """
    shown = {name: _delogged(name, estimate) for name, estimate in estimates.items()}
    known = {name: value for name, value in (nominal or {}).items() if name in shown}
    believed = {name: 10**value if name.startswith(_LOG) else value for name, value in known.items()}
    sizes: dict[str, list[float]] = {}
    for name, estimate in shown.items():
        sizes.setdefault(estimate.unit, []).extend((estimate.value, believed.get(name, estimate.value)))
    units = {unit: scale(values, unit) for unit, values in sizes.items()}
    rows = []
    for name, estimate in shown.items():
        factor, unit = units[estimate.unit]
        low, high = (factor * end for end in estimate.ci95)
        words, before = told(factor * estimate.value, (low, high)), believed.get(name)
        value = words.value if estimate.identifiable else number(factor * estimate.value, 3)
        row = {
            "name": name,
            "symbol": symbol_html(symbols.get(name, "")),
            "unit": unit,
            "nominal": scaled(before, factor),
        }
        row |= {"value": value, "low": words.low, "high": words.high, "identifiable": estimate.identifiable}
        rows.append(row | {"drawn": _change_drawn(before, estimate)})
    return {"rows": rows, "compared": nominal is not None, "lettered": any(row["symbol"] for row in rows)}


def limit_share(check: Check) -> float | None:
    """The value of a check as a share of its limit; None where there is none to draw."""
    share = check.value / check.limit if check.limit and math.isfinite(check.limit) else math.nan
    return share if math.isfinite(share) and share >= 0 else None


def record_rows(finding: Finding) -> list[list[str]]:
    """The records: name, role, samples, span."""
    rows = []
    for trace in finding.traces:
        x = np.asarray(trace.abscissa, dtype=float)
        span = f"{number(float(x[-1] - x[0]), 3)} s" if trace.axis == "t_s" and len(x) else DASH
        rows.append([trace.name, PARTS.get(trace.role, PARTS["train"]), f"{len(trace.measured)}", span])
    return rows


def smallest_rows(finding: Finding) -> list[list[str]]:
    """The smallest effects that would have been seen."""
    rows = []
    for name, value in sorted(finding.smallest_detectable.items()):
        effect = finding.effect(name)
        amplitude = effect.amplitude() if effect else None
        words, unit = (parameter_words(amplitude.name), amplitude.unit) if amplitude else ("", "")
        rows.append([effect_words(name), words, quantity(value, unit)])
    return rows


def _delogged(name: str, estimate: Fitted) -> Fitted:
    if not name.startswith(_LOG):
        return estimate
    low, high = (10**end for end in estimate.ci95)
    return Fitted(10**estimate.value, (low, high), estimate.unit.removeprefix("log10 "), estimate.identifiable)


def _change_drawn(nominal: float | None, estimate: Fitted) -> dict[str, Any] | None:
    """Change from nominal with its interval as places on a small drawing of -50 to +50 %."""
    if not nominal or not math.isfinite(nominal) or not math.isfinite(estimate.value):
        return None
    off, *ends = (100 * (v / nominal - 1) for v in (estimate.value, *estimate.ci95))
    places = (
        70 + 1.3 * min(max(v, -50.0), 50.0) if math.isfinite(v) else (5.0 if v < 0 else 135.0)
        for v in (off, min(ends), max(ends))
    )
    drawn = dict(zip(("value", "low", "high"), places, strict=True))
    return drawn | {"change": change(estimate.value, nominal), "kind": "own" if estimate.identifiable else "vague"}
