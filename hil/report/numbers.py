"""The numbers of a finding: those of `report.json`, and the rows of the page's tables."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from typing import Any, Final

from hil.report.mathml import symbol_html
from hil.report.words import PARTS, column_words, error_cells, interpolation, parameter_words
from models.effects import effect_words
from models.effects.equation import LETTERS
from models.formula import line_text
from models.identification.finding import NEXT_TOML, STAGES, Finding, Fitted, FoundEffect
from models.identification.profile import LINE
from models.words.quantities import DASH, change, measured_unit, number, percent, plain, quantity, scale, with_interval

_LOG: Final = "log10_"
_AS_IT_IS: Final = (
    "next_experiment", "smallest_detectable", "seconds", "kind", "nominal", "cannot_show", "reasons", "statements",
    "leading", "stopped", "timings",
)  # fmt: skip
"""What `report.json` has of a finding under the same name."""
# what is identifiable stands under `told`
_as_json = partial(asdict, dict_factory=lambda pairs: {"told" if k == "identifiable" else k: v for k, v in pairs})


def report_json(finding: Finding) -> dict[str, Any]:
    """The object that `report.json` and `close-loop --json` hold; numbers that are not finite are None."""
    proposal = finding.proposal
    document = {
        "verdict": finding.verdict,
        "effects": [_effect(effect) for effect in finding.effects],
        "error": {
            "quantity": finding.quantity,
            "unit": finding.error_unit,
            "measure": finding.measure,
            **{part: {s: finding.error.get(part, {}).get(s) for s in STAGES} for part in PARTS},
            "noise_floor": finding.noise_floor,
            "beside": {name: asdict(column) for name, column in finding.beside.items()},
        },
        "next_experiment_file": proposal and NEXT_TOML,
        "next_experiment_separates": [_as_json(one) for one in proposal.separations] if proposal else [],
        "next_experiment_shows": list(proposal.shows) if proposal else [],
        "calibration": {
            name: {"nominal": finding.nominal.get(name), **_as_json(estimate)}
            for name, estimate in finding.calibration.items()
        },
        "checks": [{**_as_json(check), "passed": check.ok} for check in finding.checks],
        "findings": [found.to_dict() for found in finding.findings],
        "candidates": [_as_json(candidate) for candidate in finding.candidates],
        "profiles": {one.pop("name"): {**one, "line95": LINE} for one in map(asdict, finding.profiles)},
        "disagreeing_records": [_as_json(one) for one in finding.disagreeing],
        "equations": [line_text(line) for line in finding.equations],
        "records": [
            {"name": trace.name, "role": trace.role, "rows": len(trace.measured)}
            | ({"treated": list(trace.treated)} if trace.treated else {})
            for trace in finding.traces
        ],
        "residual": finding.dependence and _as_json(finding.dependence),
    }
    cleaned: dict[str, Any] = plain(document | {name: getattr(finding, name) for name in _AS_IT_IS})
    return cleaned


def _effect(effect: FoundEffect) -> dict[str, Any]:
    keys = {name: f"confidence_{name}" for name in ("score", "calibrated", "meaning")}
    return {keys.get(name, name): value for name, value in _as_json(effect).items()}


def error_rows(finding: Finding) -> list[list[str]]:
    """Errors by part and stage, and the share of the nominal error that is gone."""
    rows = []
    for one, (part, words) in itertools.product(finding.by_column, PARTS.items()):
        errors = one.error.get(part, {})
        first, last = errors.get("nominal", math.nan), errors.get("augmented", math.nan)
        compared = first and math.isfinite(first) and math.isfinite(last)
        compared = compared and not (part == "train" and interpolation(finding))
        *shown, floor = error_cells(one, part)
        label = f"{words}, {column_words(one.quantity)[0]}" if finding.beside else words
        rows.append([label, *shown, percent(1 - last / first) if compared else DASH, floor])
    return rows


def parameters(
    estimates: Mapping[str, Fitted],
    nominal: Mapping[str, float] | None = None,
    symbols: Mapping[str, str] = LETTERS,
) -> dict[str, Any]:
    """Parameters with their 95 % intervals, beside the nominal values where there are any. Instead of a logarithm its
    argument is shown. A unit has one prefix in all rows.
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
        words, before = with_interval(factor * estimate.value, (low, high)), believed.get(name)
        value = words.value if estimate.identifiable else number(factor * estimate.value, 3)
        row: dict[str, Any] = {"name": name, "symbol": symbol_html(symbols.get(name, "")), "unit": unit, "value": value}
        row |= {"low": words.low, "high": words.high, "identifiable": estimate.identifiable}
        rows.append({**row, "nominal": before and factor * before, "drawn": _change_drawn(before, estimate)})
    return {"rows": rows, "compared": nominal is not None, "lettered": any(row["symbol"] for row in rows)}


def smallest_rows(finding: Finding) -> list[list[str]]:
    """The smallest detectable effects: name, amplitude, value; none where a value was not found."""
    rows = []
    for name, value in sorted(finding.smallest_detectable.items()):
        if not value > 0:
            continue
        effect = finding.effect(name)
        amplitude = effect.amplitude() if effect else None
        words, unit = (parameter_words(amplitude.name), amplitude.unit) if amplitude else ("", "")
        rows.append([effect_words(name), words, quantity(value, measured_unit(unit, finding.unit))])
    return rows


def _delogged(name: str, estimate: Fitted) -> Fitted:
    if not name.startswith(_LOG):
        return estimate
    low, high = (10**end for end in estimate.ci95)
    return Fitted(10**estimate.value, (low, high), estimate.unit.removeprefix("log10 "), estimate.identifiable)


def _change_drawn(nominal: float | None, estimate: Fitted) -> dict[str, Any] | None:
    """Change from nominal with its interval, as positions on a small drawing of -50 to +50 %."""
    if not nominal or not math.isfinite(nominal) or not math.isfinite(estimate.value):
        return None
    off, *ends = (100 * (v / nominal - 1) for v in (estimate.value, *estimate.ci95))
    positions = (
        70 + 1.3 * min(max(v, -50.0), 50.0) if math.isfinite(v) else (5.0 if v < 0 else 135.0)
        for v in (off, min(ends), max(ends))
    )
    drawn = dict(zip(("value", "low", "high"), positions, strict=True))
    return drawn | {"change": change(estimate.value, nominal), "kind": "own" if estimate.identifiable else "vague"}
