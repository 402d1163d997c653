"""The fit of a model on all its records, down to the kind's final stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from models.identification.fit import FINE, NARROW, WIDE, Fit, narrowing
from models.identification.judging import NEAR_NOISE
from models.identification.kind import Kind
from models.identification.refitting import refit
from models.record import Record

_WAYS_DOWN = 3
_REFINES = 0.01  # of the cost, the least that another way down is worth


def whole(
    kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Mapping[str, float], enough: float = NEAR_NOISE
) -> Fit:
    """The best of several ways to a fit on `records` (`refit`), finished."""
    begun = refit(kind, records, effects, start, enough)
    return finished(kind, records, effects, narrowing(kind, records, effects, begun, kind.stages - 1, FINE))


def finished(kind: Kind, records: Sequence[Record], effects: Sequence[str], fit: Fit) -> Fit:
    """`fit` at the kind's final stage, descended anew as long as that helps: where one way down ends another may begin. Wide secants only
    where more than the noise is left. A kind with one stage has no other."""
    if kind.stages == 1:
        return fit
    widths = FINE if fit.chi2 < NEAR_NOISE else (*WIDE, FINE[-1])
    best = narrowing(kind, records, effects, fit.theta, kind.final, widths)
    for _ in range(_WAYS_DOWN):
        again = narrowing(kind, records, effects, best.theta, kind.final, (NARROW[0], *FINE))
        if again.cost > (1 - _REFINES) * best.cost:
            return min(best, again, key=lambda fit: fit.cost)
        best = again
    return best
