"""Columns of a record: which of them it needs, and the ranges of their values."""

from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

TIME = "t_s"
ACCELERATION = "acceleration_m_s2"
"""Of a body along its path: a second measured column."""
LOAD_PLACES = ("load_position_m", "load_angle_rad")
"""Of the load that an axis moves, by an encoder of its own: a second measured column."""
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


_FORCE = Range(-1e3, 1e3, "between -1000 and 1000 N")  # of a capsule
SLOWEST_PULL = 1e-7
"""In m/s: a slip of a tenth of a millimetre every quarter of an hour."""
_PLACE = Range(-100.0, 100.0, "between -100 and 100 m")  # of the same

RANGES = MappingProxyType(  # what a value of a column may be, by column
    {
        "position_m": _PLACE,
        "carriage_position_m": _PLACE,
        "force_N": _FORCE,
        "valley_N": _FORCE,
        "peak_N": _FORCE,
        "velocity_m_s": Range(SLOWEST_PULL, 1.0, f"the speed of the pull, {SLOWEST_PULL:g} to 1 m/s"),
        "mean_velocity_m_s": Range(-10.0, 10.0, "between -10 and 10 m/s"),
        "coil_current_A": Range(-1e3, 1e3, "between -1000 and 1000 A"),
        "coil_voltage_V": Range(-1e4, 1e4, "between -10000 and 10000 V"),
        "period_s": Range(1e-6, 1e4, "1e-6 to 1e4 s"),
        "duty": Range(0.0, 1.0, "a share between 0 and 1"),
        "cycles": Range(1.0, 1e9, "a number of periods, at least 1"),
        "drive_on": Range(0.0, 1.0, "between 0 (off) and 1 (on)"),
        "frequency_Hz": Range(0.0, 1e9, "positive, in Hz", above=True),
        "storage_modulus_Pa": Range(0.0, 1e12, "positive, in Pa", above=True),
        "loss_modulus_Pa": Range(0.0, 1e12, "not negative, in Pa"),
        "angle_rad": Range(-1e6, 1e6, "between -1e6 and 1e6 rad"),
        "torque_N_m": Range(-1e6, 1e6, "between -1e6 and 1e6 N m"),
        "velocity_rad_s": Range(-1e5, 1e5, "between -1e5 and 1e5 rad/s"),
        "load_N": Range(-1e9, 1e9, "between -1e9 and 1e9 N"),
        "friction_coefficient": Range(0.0, 100.0, "not negative, at most 100"),
        ACCELERATION: Range(-1e5, 1e5, "between -1e5 and 1e5 m/s2"),
        "load_position_m": _PLACE,
        "load_angle_rad": Range(-1e6, 1e6, "between -1e6 and 1e6 rad"),
        "load_N_m": Range(-1e9, 1e9, "between -1e9 and 1e9 N m"),
    }
)
"""Ranges of columns, where a kind states no other."""
