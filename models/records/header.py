"""Sentences for headers that do not have the columns of a kind of rig."""

import difflib
from collections.abc import Sequence

from models.files.units import factor, split_unit
from models.rigs.columns import TIME
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS

_TIME_NAMES = ("time", "timestamp", "seconds", "sec")


def missing_in_layouts(kind: RigKind, header: Sequence[str]) -> list[tuple[list[tuple[str, ...]], tuple[str, ...]]]:
    """The columns that `header` lacks to be a record of each layout of `kind` that none of its columns rules out, and
    those that it may have besides.
    """
    held = kind.layouts
    fitting = [one for one in held if set(one.own()) & set(header)] or held
    return [(one.lacking(header), tuple(name for name in one.optional if name not in header)) for one in fitting]


def check_header(where: str, kind: RigKind, header: Sequence[str], with_measured: bool = True) -> None:
    """Refuse a header that lacks a column of `kind`, saying which, and what in the header was probably meant; one of a
    whole record of another kind without any measured column of `kind`; and optional columns in another unit, which
    would be ignored without a word.
    """
    held = kind.columns(header)
    missing = held.lacking(header, with_measured)
    whole = [one for one in KINDS.values() if not one.columns(header).lacking(header)]
    if not missing and len(whole) == 1 and kind not in whole and not set(held.measured) & set(header):
        raise ValueError(f"{where}: record must be one of a {kind.id} rig; got the columns of kind {whole[0].id}")
    optional = (name for name in (*held.given_by_rig, *held.optional) if name not in header)
    for name in (name for alternatives in missing for name in alternatives) if missing else optional:
        _refuse_unit(where, name, header, kind)
    if not missing:
        return
    wanted = _wanted(kind, header, with_measured)
    if found := " or ".join(one.id for one in whole if one != kind):
        raise ValueError(
            f"{where}: record must be one of a {kind.id} rig (column {wanted} is missing); got the columns of kind"
            f" {found}"
        )
    free = [name for name in header if name not in kind.known]
    raise ValueError(
        f"{where}: header must have the column {wanted} (kind {kind.id}); got {_listed(header)}{_hint(missing, free)}"
    )


def _wanted(kind: RigKind, header: Sequence[str], with_measured: bool) -> str:
    """The columns that `header` lacks; where it has none of any variant of `kind`, those of each."""
    held = kind.layouts
    if any(set(one.own()) & set(header) for one in held):
        held = (kind.columns(header),)
    return ", or ".join(", ".join(map(" or ".join, one.lacking(header, with_measured))) for one in held)


def _hint(missing: Sequence[tuple[str, ...]], free: Sequence[str]) -> str:
    """Which column of ours a column of the file was probably meant to be; nothing where none is like it."""
    for name in (name for alternatives in missing for name in alternatives):
        clock = [other for other in free if name == TIME and other.lower().startswith(_TIME_NAMES)]
        close = clock or difflib.get_close_matches(name, free, n=1, cutoff=0.5)
        if close:
            return f"; where it has {close[0]!r}, did you mean {name!r}?"
    return "" if free else "; it has no further columns"


def _refuse_unit(where: str, name: str, header: Sequence[str], kind: RigKind) -> None:
    stem, unit = split_unit(name)
    known = kind.known
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
