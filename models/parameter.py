"""A number of the model: value, unit, bounds, source, and whether a fit may touch it; and sets of them in TOML."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections import namedtuple
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

SETS = Path(__file__).parent / "sets"
Name = str | tuple[str, str]
"""Key of a parameter or a state: its name; of an effect (or a drive) the id and the name."""
_ROUNDING = 1e-9  # of a value, by which it may be beyond its bounds
Role = Literal["", "phase", "place"]


@dataclass(frozen=True)
class Parameter:
    """One number: `value` in `unit`, believed to lie in [`lower`, `upper`], taken from `source`; `fit` lets calibration
    change it, which `spread` (a standard deviation, beside data in units of their noise) holds to `value` where the
    data say little. `role` tells a search what it is: the "phase" of a cycle, which follows from two quadratures, or a
    "place" along the lumen, which may lie anywhere on a record's track. Below the size `least`, of either sign, its
    effect is a case of one of its confounders. In a model it says to which `effect` it belongs, "" for the base.
    `symbol` is its letter in equations.
    """

    name: str
    value: float
    unit: str = "1"
    lower: float = float("-inf")
    upper: float = float("inf")
    source: str = ""
    fit: bool = False
    spread: float = float("inf")
    role: Role = ""
    least: float = 0.0
    effect: str = ""
    symbol: str = ""

    @classmethod
    def near(cls, name: str, value: float, unit: str, least: float, most: float, source: str) -> Parameter:
        """A number for calibration to fit, within `least` to `most` times its `value` of either sign."""
        lower, upper = sorted((least * value, most * value))
        return cls(name, value, unit, lower, upper, source, fit=True)

    @property
    def key(self) -> Name:
        """The key of its value in a model."""
        return (self.effect, self.name) if self.effect else self.name

    def __post_init__(self) -> None:
        if self.lower > self.upper:
            raise ValueError(f"{self.name} must have its lower bound first; got {self.lower:g}, {self.upper:g}")
        if not self.lower <= self.value <= self.upper:
            raise ValueError(
                f"{self.name} must lie in [{self.lower:g}, {self.upper:g}] {self.unit}; got {self.value:g}"
            )

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", self.name or name)
        object.__setattr__(self, "source", self.source or getattr(owner, "source", ""))
        before = next((vars(base)[name] for base in owner.__mro__[1:] if name in vars(base)), None)
        object.__setattr__(self, "symbol", self.symbol or getattr(before, "symbol", ""))

    def at(self, value: float) -> Parameter:
        """The same parameter at another value."""
        return replace(self, value=float(value))

    def holds(self, value: float) -> bool:
        """Whether `value` lies within the bounds, up to rounding."""
        slack = _ROUNDING * max(abs(value), 1e-12)
        return math.isfinite(value) and self.lower - slack <= value <= self.upper + slack


def nearest(name: str, known: Mapping[str, object] | list[str] | tuple[str, ...]) -> str:
    """A hint for an unknown name: the nearest known one, else all of them."""
    match = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f"did you mean {match[0]!r}?" if match else "known: " + ", ".join(sorted(known))


@dataclass(frozen=True)
class ParameterSet:
    """Named parameters with a title, where they come from, and what they are not."""

    name: str
    title: str
    source: str
    caution: str
    parameters: Mapping[str, Parameter]

    def __getitem__(self, name: str) -> float:
        if name not in self.parameters:
            raise KeyError(f"parameter set {self.name} has no {name!r}; {nearest(name, dict(self.parameters))}")
        return self.parameters[name].value


@cache
def load_set(name: str) -> ParameterSet:
    """Read `models/sets/NAME.toml`; a miss names the nearest set."""
    raw = tomllib.loads(one_of(SETS, name, ".toml", "parameter set").read_text(encoding="utf-8"))
    head = raw["set"]
    parameters = {
        key: Parameter(key, float(entry["value"]), entry["unit"], source=entry.get("source", head["source"]))
        for key, entry in raw["parameters"].items()
    }
    return ParameterSet(name, head["title"], head["source"], head["caution"], MappingProxyType(parameters))


def one_of(folder: Path, name: str, ending: str, what: str) -> Path:
    """The file `name` of a folder of ours. Raises ValueError, which names the nearest, for `what` is not there."""
    path = folder / f"{name}{ending}"
    if not path.is_file():
        known = sorted(other.stem for other in folder.glob(f"*{ending}"))
        raise ValueError(f"{what} must be one that exists; got {name!r}; {nearest(name, known)}")
    return path


def settings(file: str) -> Any:
    """The chosen numbers in `settings.toml` beside the module `file`, by name. Each stands there as `[value, unit,
    meaning, what it was chosen on]`; lists are tuples here.
    """

    def fixed(value: Any) -> Any:
        return tuple(map(fixed, value)) if isinstance(value, list) else value

    rows = tomllib.loads(Path(file).with_name("settings.toml").read_text(encoding="utf-8"))
    return namedtuple("Settings", rows)(*(fixed(value) for value, *_ in rows.values()))
