"""The columns that a record of each kind of rig must have, in one table, and sentences for headers that do not have
them.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from models.files.units import factor, split_unit

TIME = "t_s"
TIME_SERIES_ROWS = 2_000_000
TABLE_ROWS = 100_000


@dataclass(frozen=True)
class Columns:
    """What a kind's record holds: `driven` lists the columns that must be there, alternatives side by side."""

    driven: tuple[tuple[str, ...], ...]
    measured: tuple[str, ...]
    time: bool
    minimum: int
    given_by_rig: tuple[str, ...] = ()

    @property
    def limit(self) -> int:
        """Most rows that are read."""
        return TIME_SERIES_ROWS if self.time else TABLE_ROWS

    def required(self, with_measured: bool = True) -> tuple[tuple[str, ...], ...]:
        """Every column that must be there, each as a tuple of alternatives."""
        time = ((TIME,),) if self.time else ()
        return time + self.driven + (tuple((name,) for name in self.measured) if with_measured else ())

    def known(self) -> tuple[str, ...]:
        """Every name this kind gives a meaning to."""
        return (*(name for alternatives in self.required() for name in alternatives), *self.given_by_rig)


COLUMNS = MappingProxyType(
    {
        "pull": Columns((("position_m",),), ("force_N",), True, 100),
        "magnetic": Columns((("carriage_position_m",),), ("position_m",), True, 100),
        "coil": Columns((("coil_current_A", "coil_voltage_V"),), ("position_m",), True, 100),
        "vibro": Columns((("drive_on", "coil_voltage_V"),), ("position_m",), True, 100),
        "vibro_table": Columns((("period_s",), ("duty",), ("cycles",)), ("mean_velocity_m_s",), False, 4),
        "axis": Columns((("position_m",),), ("force_N",), True, 100),
        "periods": Columns((), ("period_s", "valley_N", "peak_N"), False, 3, ("velocity_m_s",)),
        "dma": Columns((("frequency_Hz",),), ("storage_modulus_Pa", "loss_modulus_Pa"), False, 3),
    }
)

_FORCE = (-1e3, 1e3, "between -1000 and 1000 N")
_PLACE = (-100.0, 100.0, "between -100 and 100 m")

RANGES = MappingProxyType(
    {
        "position_m": _PLACE,
        "carriage_position_m": _PLACE,
        "force_N": _FORCE,
        "valley_N": _FORCE,
        "peak_N": _FORCE,
        "velocity_m_s": (0.0, 1.0, "the speed of the pull, positive and at most 1 m/s"),
        "mean_velocity_m_s": (-10.0, 10.0, "between -10 and 10 m/s"),
        "coil_current_A": (-1e3, 1e3, "between -1000 and 1000 A"),
        "coil_voltage_V": (-1e4, 1e4, "between -10000 and 10000 V"),
        "period_s": (0.0, 1e4, "positive, in s"),
        "duty": (0.0, 1.0, "a share between 0 and 1"),
        "cycles": (1.0, 1e9, "a number of periods, at least 1"),
        "drive_on": (0.0, 1.0, "between 0 (off) and 1 (on)"),
        "frequency_Hz": (0.0, 1e9, "positive, in Hz"),
        "storage_modulus_Pa": (0.0, 1e12, "positive, in Pa"),
        "loss_modulus_Pa": (0.0, 1e12, "not negative, in Pa"),
    }
)
ABOVE = frozenset({"velocity_m_s", "period_s", "frequency_Hz", "storage_modulus_Pa"})
"""Columns whose lower bound is not a value itself."""
_TIME_NAMES = ("time", "timestamp", "seconds", "sec")


def first_wrong(name: str, values: NDArray[np.float64]) -> int | None:
    """Row of the first value out of the range of the column `name`; None where there is none."""
    if name not in RANGES:
        return None
    lower, upper, _ = RANGES[name]
    good = ((values > lower) if name in ABOVE else (values >= lower)) & (values <= upper)
    return None if good.all() else int(np.argmin(good))


def missing_columns(kind: str, header: Sequence[str], with_measured: bool = True) -> list[tuple[str, ...]]:
    """The columns of `kind` that `header` lacks, each as a tuple of alternatives."""
    return [names for names in COLUMNS[kind].required(with_measured) if not set(names) & set(header)]


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
    wanted = ", ".join(" or ".join(alternatives) for alternatives in missing)
    if others:
        found = " or ".join(others)
        raise ValueError(
            f"{where}: record must be one of a {kind} rig (column {wanted} is missing); got the columns of kind {found}"
        )
    free = [name for name in header if name not in COLUMNS[kind].known()]
    raise ValueError(
        f"{where}: header must have the column {wanted} (kind {kind}); got {_listed(header)}; {_hint(missing, free)}"
    )


def _hint(missing: Sequence[tuple[str, ...]], free: Sequence[str]) -> str:
    """Which column of ours a column of the file was probably meant to be."""
    for name in (name for alternatives in missing for name in alternatives):
        clock = [other for other in free if name == TIME and other.lower().startswith(_TIME_NAMES)]
        close = clock or difflib.get_close_matches(name, free, n=1, cutoff=0.5)
        if close:
            return f"where it has {close[0]!r}, did you mean {name!r}?"
    return "none of its further columns is like it" if free else "it has no further columns"


def check_unit_names(where: str, kind: str, header: Sequence[str]) -> None:
    """Refuse optional columns of `kind` written in another unit; they would be ignored without a word."""
    for name in COLUMNS[kind].given_by_rig:
        if name not in header:
            _refuse_unit(where, name, header, kind)


def _refuse_another_kind(where: str, kind: str, header: Sequence[str]) -> None:
    """A whole record of one other kind that holds no measured column of `kind` was not made on such a rig."""
    others = [other for other in COLUMNS if _fits(other, header)]
    if len(others) == 1 and kind not in others and not set(COLUMNS[kind].measured) & set(header):
        raise ValueError(f"{where}: record must be one of a {kind} rig; got the columns of kind {others[0]}")


def _fits(kind: str, header: Sequence[str]) -> bool:
    return all(set(alternatives) & set(header) for alternatives in COLUMNS[kind].required())


def _refuse_unit(where: str, name: str, header: Sequence[str], kind: str) -> None:
    stem, unit = split_unit(name)
    known = COLUMNS[kind].known()
    for got in header:
        other, stated = split_unit(got)
        same = other.lower() == stem.lower() and (not stated or factor(stated, unit) is not None)
        if unit and same and got not in known:
            raise ValueError(
                f"{where}: column must be {name!r}, in {unit.replace('_', '/')}; got {got!r}: convert and rename it"
            )


def _listed(header: Sequence[str]) -> str:
    shown = [repr(name[:40]) for name in header[:8]]
    return ", ".join(shown) + (f" and {len(header) - 8} more" if len(header) > 8 else "")
