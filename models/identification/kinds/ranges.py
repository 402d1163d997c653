"""The law of an effect with other ranges, grids and a probe of a kind's own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from models.effects.effect import Effect
from models.parameter import Parameter

Range = tuple[float, float, float]
"""Value, lower and upper bound of a parameter."""


@dataclass(frozen=True)
class Ranges:
    """Ranges of an effect's parameters, its grids of starts and its probe, as they follow from records."""

    of: Mapping[str, Range] = field(default_factory=dict)
    grid: Mapping[str, tuple[float, ...]] | None = None
    probe: float | None = None


def ranged(
    effect: type[Effect], own: Ranges, names: Callable[[Parameter], Parameter] = lambda p: p, **hooks: Any
) -> type[Effect]:
    """`effect` in its `own` ranges, with parameters renamed by `names` and `hooks` in place of the effect's."""
    parameters = tuple(names(_within(p, own.of.get(p.name))) for p in effect.parameters())
    called = dict(zip((p.name for p in effect.parameters()), (p.name for p in parameters), strict=True))
    grid = effect.grid if own.grid is None else own.grid
    space: dict[str, Any] = {
        "__doc__": effect.__doc__,
        "grid": MappingProxyType({called[name]: values for name, values in grid.items() if name in called}),
        "probe": effect.probe if own.probe is None else own.probe,
        "parameters": classmethod(lambda cls: parameters),
        **hooks,
    }
    made: type[Effect] = type(effect.__name__, (effect,), space)
    return made


def _within(p: Parameter, own: Range | None) -> Parameter:
    """`p` in another range, with its spread in proportion."""
    if own is None:
        return p
    value, lower, upper = own
    spread = p.spread * (upper - lower) / (p.upper - p.lower) if np.isfinite(p.spread) else p.spread
    return replace(p, value=value, lower=lower, upper=upper, spread=spread)
