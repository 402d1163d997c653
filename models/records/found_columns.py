"""A header without the columns of a kind of rig: what is refused, and the table `[columns]` that is proposed."""

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from models.files.toml import beside, inline_table
from models.files.units import factor, split_unit, unit, unit_of
from models.rigs.columns import TIME
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.mapping import MappedColumn

_SHOWN: Final = 8  # names in a comment
_TIME_NAMES = ("time", "timestamp", "seconds", "sec")


def check_header(where: str, kind: RigKind, header: Sequence[str], with_measured: bool = True) -> None:
    """Refuse a header that lacks a column of `kind`, with the likely one in it, and one of another kind's record."""
    layout = kind.columns(header)
    lacking = layout.lacking(header, with_measured)
    missing = [name for alternatives in lacking for name in alternatives]
    whole = [one for one in KINDS.values() if not one.columns(header).lacking(header)]
    if not missing and len(whole) == 1 and kind not in whole and not set(layout.measured) & set(header):
        raise ValueError(f"{where}: record must be one of a {kind.id} rig; got the columns of kind {whole[0].id}")
    for name in missing or (name for name in layout.given_by_rig if name not in header):
        _refuse_unit(where, name, header, kind)
    if not missing:
        return
    layouts = (layout,) if any(set(one.own()) & set(header) for one in kind.layouts) else kind.layouts
    wanted = ", or ".join(", ".join(map(" or ".join, one.lacking(header, with_measured))) for one in layouts)
    if found := " or ".join(one.id for one in whole if one != kind):
        rule = f"record must be one of a {kind.id} rig (column {wanted} is missing)"
        raise ValueError(f"{where}: {rule}; got the columns of kind {found}")
    shown, more = ", ".join(repr(name[:40]) for name in header[:8]), len(header) - 8
    got = f"{shown} and {more} more" if more > 0 else shown
    hint = _hint(missing, [name for name in header if name not in kind.known])
    swinging = [one for one in missing if kind.stage and kind.drive is None and one in layout.measured]
    hint += "".join(f"; one that swings freely has [rig] driven = {one!r}" for one in swinging)
    raise ValueError(f"{where}: header must have the column {wanted} (kind {kind.id}); got {got}{hint}")


def _hint(missing: Sequence[str], free: Sequence[str]) -> str:
    """The column of the file that is most like a missing one."""
    for name in missing:
        clock = [other for other in free if name == TIME and other.lower().startswith(_TIME_NAMES)]
        close = clock or difflib.get_close_matches(name, free, n=1, cutoff=0.5)
        if close:
            return f"; where it has {close[0]!r}, did you mean {name!r}?"
    return "" if free else "; it has no further columns"


def _refuse_unit(where: str, name: str, header: Sequence[str], kind: RigKind) -> None:
    got = next((other for other in header if other not in kind.known and nearly(other, name)), None)
    if got is not None:
        rule = f"column must be {name!r}, in {unit_of(name).replace('_', '/')}"
        raise ValueError(f"{where}: {rule}; got {got!r}: rename it, or map it in [columns] of the rig file")


def nearly(other: str, name: str) -> bool:
    """Whether a column of a file is called as ours is, but for its unit."""
    (stem, unit), (own, stated) = split_unit(name), split_unit(other)
    return bool(unit) and own.lower() == stem.lower() and (not stated or factor(stated, unit) is not None)


WORDS: Final[Mapping[str, str]] = beside(__file__, "words.toml")
"""Other words for the parts of our columns' names."""
# words in the names of commanded columns
_COMMANDED: Final = "command cmd reference desired target setpoint demand goal nominal feedforward"


def proposed(
    header: Sequence[str], missing: Sequence[Sequence[str]], units: Mapping[str, str], optional: Sequence[str] = ()
) -> list[MappedColumn]:
    """A source in `header`, which states the `units`, for each group of alternatives in `missing`, where one is
    recognised, then for the `optional` columns.

    A column is recognised by its unit and the words of its name, the likeliest first, then a measured one before a
    commanded one, then the shorter name; a missing one also as the last free one whose unit fits.
    """
    free = {name: _read(name, units.get(name, "")) for name in header if name}
    group_of = {name: group for group in [*missing, *([name] for name in optional)] for name in group}
    found: dict[str, MappedColumn] = {}

    def take(target: str, name: str) -> None:
        if name in free and not found.keys() & set(group_of[target]):
            found[target] = MappedColumn(target, name, free.pop(name)[1] or None)

    def take_likeliest(targets: list[str]) -> None:
        likely = [
            (-score, commanded(stem), len(_words(stem)), k, name)
            for k, target in enumerate(targets)
            for name, (stem, stated) in free.items()
            if (score := _likeness(target, stem, stated))
        ]
        for *_, k, name in sorted(likely):
            take(targets[k], name)

    wanted = [name for group in missing for name in group]
    take_likeliest(wanted)
    for target in wanted:
        fitting = [name for name, (_, stated) in free.items() if stated and _fits(stated, target)]
        if len(fitting) == 1:
            take(target, fitting[0])
    take_likeliest(list(optional))
    return [found[target] for target in group_of if target in found]


def to_fill_in(header: Sequence[str], missing: Sequence[Sequence[str]], clocked: bool) -> list[str]:
    """Comments for a table `[columns]` on `missing` columns of which nothing in the `header` tells which they are."""
    names = ", ".join(repr(name) for name in header[:_SHOWN]) + (", ..." if len(header) > _SHOWN else "")
    lines = [
        f"# {target} = {inline_table({'column': '...', 'unit': unit_of(target)})}  # one of {names}"
        for target in (group[0] for group in missing if header)
    ]
    return [*lines, "# t_s = {rate_Hz = ...}  # where the file has no times"] if clocked else lines


def to_scale(
    header: Sequence[str], missing: Sequence[Sequence[str]], units: Mapping[str, str], found: Sequence[MappedColumn]
) -> list[str]:
    """Comments for a table `[columns]` on `missing` columns that were not `found`: the `header` has their names, but in
    a sensor's own unit (volts, counts, pixels), of which only the experimenter knows the scale.
    """
    taken, lines = {entry.column for entry in found}, []
    for target in (group[0] for group in missing if not {entry.target for entry in found} & set(group)):
        for name in header:
            stem, stated = _read(name, units.get(name, ""))
            if name and name not in taken and stated and not _fits(stated, target) and _likeness(target, stem, ""):
                table = inline_table({"column": name, "unit": unit_of(target)}).rstrip("}")
                lines.append(f"# {target} = {table}, scale = ...}}  # what 1 {stated} is in {unit_of(target)}")
                taken.add(name)
                break
    return lines


def toml_lines(entries: Sequence[MappedColumn]) -> str:
    """A table `[columns]` to paste into a rig file."""
    return "\n".join(["[columns]", *(_line(entry) for entry in entries)])


def _line(entry: MappedColumn) -> str:
    ours = unit_of(entry.target)
    if entry.unit or not ours:
        return f"{entry.target} = {inline_table(entry.table())}"
    table = inline_table(replace(entry, unit=ours).table())
    dates = "; dates and times of day need none" if entry.target == TIME else ""
    return f"{entry.target} = {table}  # the file states no unit{dates}"


def _read(name: str, stated: str) -> tuple[str, str]:
    """The words of a column's name, and its unit, which may be the whole name."""
    stem, within = split_unit(name)
    if not (stated or within) and len(name) > 1 and unit(name):
        return "", name
    return stem, stated or within


def _fits(stated: str, target: str) -> bool:
    return factor(stated, unit_of(target)) is not None


def _likeness(target: str, stem: str, stated: str) -> int:
    """Score of a name's words: 2 for a word of ours, 1 for another of its meaning; 0 where the units contradict."""
    if stated and not _fits(stated, target):
        return 0
    words, parts = _words(stem), split_unit(target)[0].split("_")
    return sum(max((1 + (word == part) for word in words if _means(word, part)), default=0) for part in parts)


def _words(stem: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z']+|[A-Z]+(?![a-z])|[A-Za-z']+", stem)]


def commanded(stem: str) -> bool:
    """Whether a column's name is that of a command."""
    return any(len(word) > 2 and known.startswith(word) for word in _words(stem) for known in _COMMANDED.split())


def _means(word: str, part: str) -> bool:
    known = (part, *WORDS.get(part, "").split())
    return word in known or (len(word) > 2 and any(one.startswith(word) for one in known)) or word == part[0]
