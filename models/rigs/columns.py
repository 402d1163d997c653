"""Columns of a record: which of them it needs, and the ranges of their values."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

TIME = "t_s"
ACCELERATION = "acceleration_m_s2"
"""Of a body along its path: a second measured column."""
LOADS = ("load_N", "load_N_m", *(f"load_{k}" for k in range(1, 10)), "pressure_Pa", "temperature_degC")
"""Logged inputs of a machine's axis: each may push, scale the friction, or do nothing."""
TIME_SERIES_ROWS = 2_000_000  # most rows of a record: half an hour at 1 kHz
TABLE_ROWS = 100_000  # most rows of a table


@dataclass(frozen=True)
class Columns:
    """Columns of a kind's record. `driven` lists the required ones, each with its alternatives; those of `given_by_rig`
    may stand in the rig file instead; `optional` ones are used if present, as are those `beside` the measured ones.
    """

    driven: tuple[tuple[str, ...], ...]
    measured: tuple[str, ...]
    time: bool = True
    minimum: int = 100
    given_by_rig: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

    @property
    def limit(self) -> int:
        """Most rows that are read."""
        return TIME_SERIES_ROWS if self.time else TABLE_ROWS

    def required(self, with_measured: bool = True) -> tuple[tuple[str, ...], ...]:
        """The required columns, each as a tuple of alternatives."""
        time = ((TIME,),) if self.time else ()
        return time + self.driven + (tuple((name,) for name in self.measured) if with_measured else ())

    def own(self) -> tuple[str, ...]:
        """The driven and the measured columns' names."""
        return (*(name for alternatives in self.driven for name in alternatives), *self.measured)

    def lacking(self, header: Iterable[str], with_measured: bool = True) -> list[tuple[str, ...]]:
        """The columns that `header` lacks, each as a tuple of alternatives."""
        return [names for names in self.required(with_measured) if not set(names) & set(header)]

    def known(self) -> tuple[str, ...]:
        """Every name that has a meaning for this kind."""
        return (
            *(name for alternatives in self.required() for name in alternatives),
            *self.given_by_rig,
            *self.optional,
            *self.beside,
        )


class Range(NamedTuple):
    """Lower and upper limit of a column's values and both in words; `above` excludes the lower one, `zero` false
    excludes 0.
    """

    lower: float
    upper: float
    words: str
    above: bool = False
    zero: bool = True

    def holds(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where `values` (n,) are within the limits or missing (NaN)."""
        within = ((values > self.lower) if self.above else (values >= self.lower)) & (values <= self.upper)
        return np.asarray((within if self.zero else within & (values != 0)) | np.isnan(values))


_TABLES = tomllib.loads(Path(__file__).with_name("ranges.toml").read_text(encoding="utf-8"))
RANGES = MappingProxyType({name: Range(**table) for name, table in _TABLES.items()})
"""Ranges of columns, where a kind states no other."""
SLOWEST_PULL = RANGES["velocity_m_s"].lower
"""In m/s: a slip of a tenth of a millimetre every quarter of an hour."""
