"""One rule for every verdict: `named` and `none` only where every check of the report passes; else `unknown`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from models.checks.finding import RecordFinding
from models.effects import BY_ID
from models.identification.finding import Check, Estimate
from models.identification.fitting.confidence import near
from models.identification.fitting.fit import Fit, axes
from models.identification.kind import Kind
from models.identification.search.forward_selection import CLEAN, Search
from models.identification.search.validation import NEAR_NOISE


def verdict_of(effects: Sequence[str], checks: Sequence[Check]) -> str:
    """`unknown` where a check fails; else `named` where there are effects and `none` where there are none."""
    if not all(check.ok for check in checks):
        return "unknown"
    return "named" if effects else "none"


def model_checks(
    kind: Kind,
    found: Search,
    spread: Mapping[str, Estimate],
    held_out: Mapping[str, float],
    findings: Sequence[RecordFinding],
    allowed: float = 0.0,
) -> tuple[Check, ...]:
    """What beside the residual's size and whiteness a verdict rests on: validation, parameters, held-out records, the
    records themselves.

    `allowed` is the mean square that the told uncertainty of the parameters allows of a fit's own residuals. Fitted to
    a share q of the records, parameters are uncertain by 1/sqrt(q) as much, so records left out may exceed 1 by 1/q
    times as much.
    """
    limit = CLEAN * (max(found.null_cost, found.sensitivity) if found.effects else min(found.null_cost, NEAR_NOISE))
    if found.effects:
        limit = max(limit, 1 + (allowed - 1) / found.trained_share)
    checks = [
        _check("validation", "validation cost", found.after, limit, "mean square on records left out of the fits"),
        _check(
            "bounds",
            "parameters at their bounds",
            len(at_bounds(kind, found.augmented, found.model)),
            0,
            "a parameter at its bound would have gone further",
        ),
    ]
    if found.effects:
        amplitudes = [f"{name}.{BY_ID[name].amplitude().name}" for name in found.effects]
        untold = sum(not spread[name].told for name in amplitudes if name in spread)
        checks.append(
            _check(
                "effects_told", "effects whose size is not told", untold, 0, "its 95 % interval is as wide as itself"
            )
        )
        if held_out:
            gain = held_out["augmented"] / max(held_out["calibrated"], 1e-300)
            checks.append(
                _check("held_out", "held-out error, augmented over calibrated", gain, 1, "of records never used before")
            )
    else:
        weak = sum(finding.severity == "weakens" for finding in findings)
        checks.append(_check("records", "findings that weaken a verdict", weak, 0, "see the findings on the records"))
    base = [estimate.told for name, estimate in spread.items() if "." not in name]
    if base:
        share = float(np.mean([not told for told in base]))
        checks.append(
            _check(
                "information", "share of calibrated parameters not told", share, 0.99, "1: these records cannot tell"
            )
        )
    return tuple(checks)


def at_bounds(kind: Kind, fit: Fit, effects: Sequence[str]) -> list[str]:
    """Names of the fitted parameters at a bound; a base parameter's 0, where the law itself ends, is none."""
    return [
        axis.name
        for axis in axes(kind, effects)
        if any(
            near(fit.theta[axis.name], bound, axis.parameter)
            for bound in (axis.parameter.lower, axis.parameter.upper)
            if bound != 0 or "." in axis.name
        )
    ]


def _check(name: str, title: str, value: float, limit: float, meaning: str) -> Check:
    return Check(name, title, float(value), float(limit), bool(value <= limit), meaning)
