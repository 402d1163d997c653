"""The numbers of a finding as `report.json` holds them."""

from dataclasses import asdict
from functools import partial
from typing import Any, Final

from hil.report.words import error_unit
from models.formula import line_text
from models.identification.finding import NEXT_TOML, STAGES, Finding, FoundEffect
from models.words.quantities import plain

_RENAMED: Final = {"identifiable": "told"}
"""Names of fields that stand under another key in JSON."""


def _named(items: list[tuple[str, Any]]) -> dict[str, Any]:
    return {_RENAMED.get(name, name): value for name, value in items}


_as_json = partial(asdict, dict_factory=_named)


def report_json(finding: Finding) -> dict[str, Any]:
    """The object that `report.json` and `close-loop --json` hold; numbers that are not finite are None."""
    document = {
        "verdict": finding.verdict,
        "effects": [_effect(effect) for effect in finding.effects],
        "error": {
            "quantity": finding.quantity,
            "unit": error_unit(finding),
            "measure": finding.measure,
            **{part: {s: finding.error.get(part, {}).get(s) for s in STAGES} for part in ("train", "holdout")},
            "noise_floor": finding.noise_floor,
        },
        "next_experiment": finding.next_experiment,
        "next_experiment_file": None if finding.proposal is None else NEXT_TOML,
        "next_experiment_separates": (
            [] if finding.proposal is None else [_as_json(one) for one in finding.proposal.separations]
        ),
        "next_experiment_shows": [] if finding.proposal is None else list(finding.proposal.shows),
        "smallest_detectable": finding.smallest_detectable,
        "seconds": finding.seconds,
        "kind": finding.kind,
        "calibration": {
            name: {"nominal": finding.nominal.get(name), **_as_json(estimate)}
            for name, estimate in finding.calibration.items()
        },
        "nominal": finding.nominal,
        "checks": [{**_as_json(check), "passed": check.ok} for check in finding.checks],
        "findings": [found.to_dict() for found in finding.findings],
        "cannot_show": finding.cannot_show,
        "reasons": list(finding.reasons),
        "candidates": [_as_json(candidate) for candidate in finding.candidates],
        "statements": list(finding.statements),
        "equations": [line_text(line) for line in finding.equations],
        "records": [{"name": trace.name, "role": trace.role, "rows": len(trace.measured)} for trace in finding.traces],
        "residual": None if finding.dependence is None else _as_json(finding.dependence),
        "timings": finding.timings,
    }
    cleaned: dict[str, Any] = plain(document)
    return cleaned


_NAMED = {"score": "confidence_score", "calibrated": "confidence_calibrated", "meaning": "confidence_meaning"}
"""Fields of an effect that stand under another name."""


def _effect(effect: FoundEffect) -> dict[str, Any]:
    found = _as_json(effect)
    curves = found.pop("curves")
    return {_NAMED.get(name, name): value for name, value in found.items()} | {"curves": curves}
