"""The law of an effect with other ranges, grids and a probe of a kind's own."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from models.effects.effect import Effect
from models.parameter import Parameter

Range = tuple[float, float, float]
"""Value, lower and upper bound of a parameter."""


def variant(
    effect: type[Effect],
    parameters: tuple[Parameter, ...],
    grid: Mapping[str, tuple[float, ...]] | None = None,
    probe: float | None = None,
    **hooks: Any,
) -> type[Effect]:
    """`effect` with these `parameters`, and with another grid, probe and `hooks` where they are given."""
    space: dict[str, Any] = {
        "__doc__": effect.__doc__,
        "grid": MappingProxyType(dict(effect.grid if grid is None else grid)),
        "probe": effect.probe if probe is None else probe,
        "parameters": classmethod(lambda cls: parameters),
        **hooks,
    }
    made: type[Effect] = type(effect.__name__, (effect,), space)
    return made
