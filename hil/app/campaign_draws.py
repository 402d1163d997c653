"""What a campaign draws for each of its cases: a key of the scenario and how its values are distributed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from models.parameter import nearest

Distribution = tuple[str, tuple[Any, ...]]


def distribution(key: str, table: Any) -> Distribution:
    """The kind and the numbers of `[draw."KEY"]`. Raises ValueError of one sentence."""
    if isinstance(table, dict) and any(isinstance(value, dict) for value in table.values()):
        raise ValueError(f'draw must have its keys in quotes, as [draw."{key}.{next(iter(table))}"]; got them without')
    if not isinstance(table, dict) or len(table) != 1:
        raise ValueError(f'draw."{key}" must have one of {", ".join(_DRAWS)}; got {table!r}')
    kind, numbers = next(iter(table.items()))
    if kind not in _DRAWS:
        raise ValueError(f'draw."{key}" must have one of {", ".join(_DRAWS)}; got {kind!r}; {nearest(kind, list(_DRAWS))}')
    if not isinstance(numbers, list) or not numbers:
        raise ValueError(f'draw."{key}" {kind} must be a list; got {numbers!r}')
    if kind != "choice" and not _are_bounds(kind, numbers):
        what = {"integer": "integers of at most 15 digits", "log_uniform": "positive numbers"}.get(kind, "finite numbers")
        raise ValueError(f'draw."{key}" {kind} must be [lower, upper], {what}; got {numbers!r}')
    return kind, tuple(numbers)


def drawn(rng: np.random.Generator, kind: str, numbers: tuple[Any, ...]) -> Any:
    """One value."""
    return _DRAWS[kind](rng, numbers)


def _are_bounds(kind: str, numbers: list[Any]) -> bool:
    known = int if kind == "integer" else int | float
    if len(numbers) != 2 or not all(isinstance(n, known) and not isinstance(n, bool) for n in numbers):
        return False
    lower, upper = numbers
    most = _MOST_INTEGER if kind == "integer" else _MOST
    return bool(-most < lower <= upper < most and (kind != "log_uniform" or lower > 0))


_MOST: Final = 1e300
_MOST_INTEGER: Final = 10**15
_DRAWS: Final[Mapping[str, Callable[[np.random.Generator, tuple[Any, ...]], Any]]] = {
    "uniform": lambda rng, n: float(rng.uniform(n[0], n[1])),
    "log_uniform": lambda rng, n: float(math.exp(rng.uniform(math.log(n[0]), math.log(n[1])))),
    "integer": lambda rng, n: int(rng.integers(n[0], n[1] + 1)),
    "choice": lambda rng, n: n[int(rng.integers(len(n)))],
}
