"""Columns of a record: which of them it needs, the ranges of their values, and what the further ones measure."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.files.units import split_unit

TIME = "t_s"
ACCELERATION = "acceleration_m_s2"
DRIVE_FORCE = "drive_force_N"
LOAD_PLACES = ("load_position_m", "load_angle_rad")
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
_ANGLE = Range(-1e6, 1e6, "between -1e6 and 1e6 rad")


class Seen(NamedTuple):
    """Of a model's step the last `reading` and `speed` in m/s, the drive's `force` in N, the load's lag `behind` it."""

    reading: Any
    speed: Any
    force: Any
    behind: Any


@dataclass(frozen=True)
class Further:
    """A further measured column: `shown` is what it has of a step, or, of a `rate`, of whose changes it is the mean
    over the interval before a sample. Its zero is unknown. An `instrument` has a scale of its own, and a delay and a
    filter, which are fitted; what is none reads as the place does.
    """

    name: str
    limits: Range
    shown: Callable[[Seen], Any]
    rate: bool = False
    instrument: bool = True

    def key(self, what: str) -> str:
        """Its key or parameter `what`, such as `std` with its unit, `offset_s` or `clock_s`."""
        stem = split_unit(self.name)[0]
        return f"{stem}_std{self.name.removeprefix(stem)}" if what == "std" else f"{stem}_{what}"


_DECLARED = (
    Further(ACCELERATION, Range(-1e5, 1e5, "between -1e5 and 1e5 m/s2"), lambda s: s.speed, rate=True),
    Further(DRIVE_FORCE, _FORCE, lambda s: s.force),
    Further(LOAD_PLACES[0], _PLACE, lambda s: s.reading - s.behind, instrument=False),
    Further(LOAD_PLACES[1], _ANGLE, lambda s: s.reading - s.behind, instrument=False),
)
FURTHER = MappingProxyType({one.name: one for one in _DECLARED})
"""An accelerometer on a body, along its path; a load cell between drive and capsule; an encoder at an axis's load."""

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
        "angle_rad": _ANGLE,
        "torque_N_m": Range(-1e6, 1e6, "between -1e6 and 1e6 N m"),
        "velocity_rad_s": Range(-1e5, 1e5, "between -1e5 and 1e5 rad/s"),
        "load_N": Range(-1e9, 1e9, "between -1e9 and 1e9 N"),
        "friction_coefficient": Range(0.0, 100.0, "not negative, at most 100"),
        "load_N_m": Range(-1e9, 1e9, "between -1e9 and 1e9 N m"),
        **{name: one.limits for name, one in FURTHER.items()},
    }
)
"""Ranges of columns, where a kind states no other."""
