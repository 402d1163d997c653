"""The columns that a record of each kind of rig must have, in one table, and sentences for headers that do not have
them.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from models.files.units import factor, split_unit

TIME = "t_s"
TIME_SERIES_ROWS = 2_000_000  # most rows of a record: half an hour at 1 kHz
TABLE_ROWS = 100_000  # most rows of a table


@dataclass(frozen=True)
class Columns:
    """What a kind's record holds: `driven` lists the columns that must be there, alternatives side by side; those of
    `given_by_rig` may stand in the rig file instead, `optional` ones are used where they are there.
    """

    driven: tuple[tuple[str, ...], ...]
    measured: tuple[str, ...]
    time: bool
    minimum: int
    given_by_rig: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()

    @property
    def limit(self) -> int:
        """Most rows that are read."""
        return TIME_SERIES_ROWS if self.time else TABLE_ROWS

    def required(self, with_measured: bool = True) -> tuple[tuple[str, ...], ...]:
        """Every column that must be there, each as a tuple of alternatives."""
        time = ((TIME,),) if self.time else ()
        return time + self.driven + (tuple((name,) for name in self.measured) if with_measured else ())

    def own(self) -> tuple[str, ...]:
        """The driven and the measured columns' names."""
        return (*(name for alternatives in self.driven for name in alternatives), *self.measured)

    def lacking(self, header: Iterable[str], with_measured: bool = True) -> list[tuple[str, ...]]:
        """The columns that `header` lacks, each as a tuple of alternatives."""
        return [names for names in self.required(with_measured) if not set(names) & set(header)]

    def known(self) -> tuple[str, ...]:
        """Every name this kind gives a meaning to."""
        return (
            *(name for alternatives in self.required() for name in alternatives),
            *self.given_by_rig,
            *self.optional,
        )


COLUMNS = MappingProxyType(
    {
        "pull": Columns((("position_m",),), ("force_N",), True, 100),
        "magnetic": Columns((("carriage_position_m",),), ("position_m",), True, 100),
        "coil": Columns((("coil_current_A", "coil_voltage_V"),), ("position_m",), True, 100),
        "vibro": Columns((("drive_on", "coil_voltage_V"),), ("position_m",), True, 100),
        "vibro_table": Columns((("period_s",), ("duty",), ("cycles",)), ("mean_velocity_m_s",), False, 4),
        "axis": Columns((("position_m",),), ("force_N",), True, 100, optional=("velocity_m_s", "load_N")),
        "periods": Columns((), ("period_s", "valley_N", "peak_N"), False, 3, ("velocity_m_s",)),
        "friction": Columns((("velocity_m_s",),), ("force_N",), False, 4, optional=("load_N",)),
        "dma": Columns((("frequency_Hz",),), ("storage_modulus_Pa", "loss_modulus_Pa"), False, 3),
    }
)

VARIANTS: Mapping[str, tuple[Columns, ...]] = MappingProxyType(
    {
        "axis": (
            Columns((("angle_rad",),), ("torque_N_m",), True, 100, optional=("velocity_rad_s", "load_N_m", "load_N")),
        ),
        "friction": (Columns((("velocity_m_s",),), ("friction_coefficient",), False, 4, optional=("load_N",)),),
    }
)
"""What a record of a kind may hold in place of its columns in `COLUMNS`: an axis that turns, a coefficient of friction
for a force.
"""

_FORCE = (-1e3, 1e3, "between -1000 and 1000 N")  # least, most, and both in words
_LOAD = (-1e9, 1e9, "between -1e9 and 1e9 N")  # the same
SLOWEST_PULL = 1e-7
"""In m/s: a tooth of a tenth of a millimetre every quarter of an hour."""
_PLACE = (-100.0, 100.0, "between -100 and 100 m")  # the same

RANGES = MappingProxyType(  # what a value of a column may be, by column
    {
        "position_m": _PLACE,
        "carriage_position_m": _PLACE,
        "force_N": _FORCE,
        "valley_N": _FORCE,
        "peak_N": _FORCE,
        "velocity_m_s": (SLOWEST_PULL, 1.0, f"the speed of the pull, {SLOWEST_PULL:g} to 1 m/s"),
        "mean_velocity_m_s": (-10.0, 10.0, "between -10 and 10 m/s"),
        "coil_current_A": (-1e3, 1e3, "between -1000 and 1000 A"),
        "coil_voltage_V": (-1e4, 1e4, "between -10000 and 10000 V"),
        "period_s": (1e-6, 1e4, "1e-6 to 1e4 s"),
        "duty": (0.0, 1.0, "a share between 0 and 1"),
        "cycles": (1.0, 1e9, "a number of periods, at least 1"),
        "drive_on": (0.0, 1.0, "between 0 (off) and 1 (on)"),
        "frequency_Hz": (0.0, 1e9, "positive, in Hz"),
        "storage_modulus_Pa": (0.0, 1e12, "positive, in Pa"),
        "loss_modulus_Pa": (0.0, 1e12, "not negative, in Pa"),
        "angle_rad": (-1e6, 1e6, "between -1e6 and 1e6 rad"),
        "torque_N_m": (-1e6, 1e6, "between -1e6 and 1e6 N m"),
        "velocity_rad_s": (-1e5, 1e5, "between -1e5 and 1e5 rad/s"),
        "load_N": _LOAD,
        "friction_coefficient": (0.0, 100.0, "not negative, at most 100"),
        "load_N_m": (*_LOAD[:2], "between -1e9 and 1e9 N m"),
    }
)
_RANGES_OF = MappingProxyType(
    {
        ("axis", "velocity_m_s"): (-1e3, 1e3, "between -1000 and 1000 m/s"),
        ("axis", "force_N"): (-1e6, 1e6, "between -1e6 and 1e6 N"),
        ("friction", "velocity_m_s"): (-1e3, 1e3, "between -1000 and 1000 m/s and not 0"),
        ("friction", "force_N"): (-1e6, 1e6, "between -1e6 and 1e6 N"),
        ("friction", "load_N"): (0.0, 1e9, "positive, at most 1e9 N"),
    }
)
"""Ranges of columns that one kind has otherwise than the others."""
NOT_ZERO = frozenset({("friction", "velocity_m_s"), ("friction", "load_N")})
"""Columns of a kind in which 0 is no value: there is no steady sliding at rest."""
ABOVE = frozenset({"frequency_Hz", "storage_modulus_Pa"})
"""Columns whose lower bound is not a value itself."""
_TIME_NAMES = ("time", "timestamp", "seconds", "sec")


def variants_of(kind: str) -> tuple[Columns, ...]:
    """What a record of `kind` may hold, its columns in `COLUMNS` first."""
    return (COLUMNS[kind], *VARIANTS.get(kind, ()))


def columns_of(kind: str, names: Iterable[str]) -> Columns:
    """What a record of `kind` with the columns `names` holds: of the kind's variants the one that has most of them."""
    there = set(names)
    return max(variants_of(kind), key=lambda held: len(there & set(held.own())))


def known_of(kind: str) -> tuple[str, ...]:
    """Every name that a kind gives a meaning to, in any of its variants."""
    return tuple(dict.fromkeys(name for one in variants_of(kind) for name in one.known()))


def range_of(kind: str, name: str) -> tuple[float, float, str] | None:
    """Lower and upper limit of a column of `kind`, and both in words; None where there are none."""
    return _RANGES_OF.get((kind, name), RANGES.get(name))


def first_wrong(kind: str, name: str, values: NDArray[np.float64]) -> int | None:
    """Row of the first value out of the range of the column `name`; None where there is none."""
    limits = range_of(kind, name)
    if limits is None:
        return None
    lower, upper, _ = limits
    above = name in ABOVE and lower == 0
    good = ((values > lower) if above else (values >= lower)) & (values <= upper)
    if (kind, name) in NOT_ZERO:
        good &= values != 0
    good |= np.isnan(values)
    return None if good.all() else int(np.argmin(good))


def missing_columns(kind: str, header: Sequence[str], with_measured: bool = True) -> list[tuple[str, ...]]:
    """The columns of `kind` that `header` lacks, each as a tuple of alternatives."""
    return columns_of(kind, header).lacking(header, with_measured)


def missing_in_variants(kind: str, header: Sequence[str]) -> list[tuple[list[tuple[str, ...]], tuple[str, ...]]]:
    """The columns that `header` lacks to be a record of each variant of `kind` that none of its columns rules out, and
    those that it may have besides.
    """
    held = variants_of(kind)
    fitting = [one for one in held if set(one.own()) & set(header)] or held
    return [(one.lacking(header), tuple(name for name in one.optional if name not in header)) for one in fitting]


def check_header(where: str, kind: str, header: Sequence[str], with_measured: bool = True) -> None:
    """Refuse a header that lacks a column of `kind`, saying which, and what in the header was probably meant."""
    missing = missing_columns(kind, header, with_measured)
    if not missing:
        _refuse_another_kind(where, kind, header)
        return
    for alternatives in missing:
        for name in alternatives:
            _refuse_unit(where, name, header, kind)
    others = [other for other in COLUMNS if other != kind and _fits(other, header)]
    wanted = _wanted(kind, header, with_measured)
    if others:
        found = " or ".join(others)
        raise ValueError(
            f"{where}: record must be one of a {kind} rig (column {wanted} is missing); got the columns of kind {found}"
        )
    free = [name for name in header if name not in known_of(kind)]
    raise ValueError(
        f"{where}: header must have the column {wanted} (kind {kind}); got {_listed(header)}{_hint(missing, free)}"
    )


def _wanted(kind: str, header: Sequence[str], with_measured: bool) -> str:
    """The columns that `header` lacks; where it has none of any variant of `kind`, those of each."""
    held = variants_of(kind)
    if any(set(one.own()) & set(header) for one in held):
        held = (columns_of(kind, header),)
    return ", or ".join(", ".join(map(" or ".join, one.lacking(header, with_measured))) for one in held)


def _hint(missing: Sequence[tuple[str, ...]], free: Sequence[str]) -> str:
    """Which column of ours a column of the file was probably meant to be; nothing where none is like it."""
    for name in (name for alternatives in missing for name in alternatives):
        clock = [other for other in free if name == TIME and other.lower().startswith(_TIME_NAMES)]
        close = clock or difflib.get_close_matches(name, free, n=1, cutoff=0.5)
        if close:
            return f"; where it has {close[0]!r}, did you mean {name!r}?"
    return "" if free else "; it has no further columns"


def check_unit_names(where: str, kind: str, header: Sequence[str]) -> None:
    """Refuse optional columns of `kind` written in another unit; they would be ignored without a word."""
    held = columns_of(kind, header)
    for name in (*held.given_by_rig, *held.optional):
        if name not in header:
            _refuse_unit(where, name, header, kind)


def _refuse_another_kind(where: str, kind: str, header: Sequence[str]) -> None:
    """A whole record of one other kind that holds no measured column of `kind` was not made on such a rig."""
    others = [other for other in COLUMNS if _fits(other, header)]
    if len(others) == 1 and kind not in others and not set(columns_of(kind, header).measured) & set(header):
        raise ValueError(f"{where}: record must be one of a {kind} rig; got the columns of kind {others[0]}")


def _fits(kind: str, header: Sequence[str]) -> bool:
    return all(set(alternatives) & set(header) for alternatives in columns_of(kind, header).required())


def _refuse_unit(where: str, name: str, header: Sequence[str], kind: str) -> None:
    stem, unit = split_unit(name)
    known = known_of(kind)
    for got in header:
        other, stated = split_unit(got)
        same = other.lower() == stem.lower() and (not stated or factor(stated, unit) is not None)
        if unit and same and got not in known:
            raise ValueError(
                f"{where}: column must be {name!r}, in {unit.replace('_', '/')}; got {got!r}: rename it, or say in"
                " [columns] of the rig file what it is"
            )


def _listed(header: Sequence[str]) -> str:
    shown = [repr(name[:40]) for name in header[:8]]
    return ", ".join(shown) + (f" and {len(header) - 8} more" if len(header) > 8 else "")
