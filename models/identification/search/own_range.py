"""Effects that hold another as a case: a wave so long that it stands everywhere at once is a force in time. Within its
own range a parameter keeps the size from which on its effect is what it is called.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from models.identification.fitting.fit import Axis, Problem, narrowing
from models.identification.kind import Kind
from models.identification.search.fitted_model import Fits
from models.identification.search.validation import Split, free_run
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


def within(
    kind: Kind, splits: Sequence[Split], effects: Sequence[str], effect: str, fits: Fits
) -> tuple[Theta, ...] | None:
    """The `fits`, one a split, of a model with `effects`, moved to where its `effect` is what it is called; None where
    they are there already.
    """
    if all(_is_there(kind, effect, theta) for theta in fits):
        return None
    return tuple(_fitted(kind, part, effects, effect, theta) for (part, _), theta in zip(splits, fits, strict=True))


def _is_there(kind: Kind, effect: str, theta: Theta) -> bool:
    return all(abs(theta.get((effect, p.name), p.value)) >= p.least for p in kind.catalogue[effect].parameters())


def _fitted(kind: Kind, part: list[Record], effects: Sequence[str], effect: str, theta: Theta) -> Theta:
    """The better of the fits on either side of zero."""
    problem = Problem.of(kind, part, effects, free_run(kind))
    sides = [replace(problem, axes=[_side(axis, effect, sign) for axis in problem.axes]) for sign in (1.0, -1.0)]
    return min(
        (narrowing(side, theta, (SET.narrow[0], *SET.fine), 10) for side in sides), key=lambda fit: fit.cost
    ).theta


def _side(axis: Axis, effect: str, sign: float) -> Axis:
    """The axis within its parameter's own range on one side of zero."""
    p = axis.parameter
    if not p.least or p.effect != effect:
        return axis
    lower, upper = (p.least, p.upper) if sign > 0 else (p.lower, -p.least)
    begin = math.copysign(max(abs(p.value), p.least), sign)
    return replace(axis, parameter=replace(p, lower=lower, upper=upper, value=begin))
