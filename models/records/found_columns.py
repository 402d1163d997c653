"""A header without the columns of a kind of rig: what is refused, and the table `[columns]` that is proposed."""

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from models.files.toml import inline_table
from models.files.units import factor, split_unit, unit, unit_of
from models.rigs.columns import TIME
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.mapping import MappedColumn

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


WORDS: Final[Mapping[str, str]] = {
    "t": "time timestamp elapsed seconds clock zeit",
    "position": "position displacement distance extension travel stroke place x q weg",
    "carriage": "carriage magnet stage slide motor actuator driven",
    "force": "force load kraft pull fx fy fz ft tangential friction",
    "load": "load normal fn last weight",
    "friction": "friction mu cof reibung reibwert traction",
    "coefficient": "coefficient coeff mu cof reibwert",
    "angle": "angle joint rotation position theta phi q winkel",
    "torque": "torque moment effort tau drehmoment",
    "current": "current i strom",
    "voltage": "voltage u v spannung",
    "velocity": "velocity speed v omega qd dq qdot",
    "frequency": "frequency f",
    "storage": "storage elastic e' g'",
    "loss": "loss viscous e'' g''",
    "valley": "valley minimum lower",
    "peak": "peak maximum upper",
    "drive": "drive switch pulse trigger",
}
"""Words with which people name what a part of our columns' names means; a beginning of one (`pos`, `disp`) will do."""
# words in the names of what was wanted and not measured
_WISHED: Final = "command cmd reference desired target setpoint demand goal nominal feedforward"


def proposed(
    header: Sequence[str], missing: Sequence[Sequence[str]], units: Mapping[str, str], optional: Sequence[str] = ()
) -> list[MappedColumn]:
    """A source in `header` for each of the `missing` columns, alternatives side by side, where one is recognised, and
    for the `optional` ones in what is left.

    `units` are those that the file states by column. A column is recognised by its unit and the words of its name, the
    likeliest first: of two as likely ones that was measured goes before one that was commanded, then the shorter name.
    One that is missing is recognised also as the only one left whose unit fits.
    """
    free = {name: _read(name, units.get(name, "")) for name in header if name}
    group_of = {name: group for group in [*missing, *([name] for name in optional)] for name in group}
    found: dict[str, MappedColumn] = {}

    def take(target: str, name: str) -> None:
        if name in free and not found.keys() & set(group_of[target]):
            found[target] = MappedColumn(target, name, free.pop(name)[1] or None)

    def take_likeliest(targets: list[str]) -> None:
        likely = [
            (-score, _wished(stem), len(_words(stem)), k, name)
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


def to_scale(
    header: Sequence[str],
    missing: Sequence[Sequence[str]],
    units: Mapping[str, str],
    found: Sequence[MappedColumn],
) -> list[str]:
    """Comments for a table `[columns]`: of the `missing` columns that were not `found` those that stand in the `header`
    by their names, but in a sensor's own unit (volts, counts, pixels), which only the experimenter can tell in ours.
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
    """The entries as a table `[columns]` to paste into a rig file."""
    return "\n".join(["[columns]", *(_line(entry) for entry in entries)])


def _line(entry: MappedColumn) -> str:
    ours = unit_of(entry.target)
    if entry.unit or not ours:
        return f"{entry.target} = {inline_table(entry.table())}"
    table = inline_table(replace(entry, unit=ours).table())
    dates = "; dates and times of day need none" if entry.target == TIME else ""
    return f"{entry.target} = {table}  # the file states no unit{dates}"


def _read(name: str, stated: str) -> tuple[str, str]:
    """The words of a column's name and its unit, which may be all that it is called."""
    stem, within = split_unit(name)
    if not (stated or within) and len(name) > 1 and unit(name):
        return "", name
    return stem, stated or within


def _fits(stated: str, target: str) -> bool:
    return factor(stated, unit_of(target)) is not None


def _likeness(target: str, stem: str, stated: str) -> int:
    """How well the words of another's name stand for the parts of ours, each 2 where it is the same word and 1 where it
    means the same; 0 where the units contradict.
    """
    if stated and not _fits(stated, target):
        return 0
    words, parts = _words(stem), split_unit(target)[0].split("_")
    return sum(max((1 + (word == part) for word in words if _means(word, part)), default=0) for part in parts)


def _words(stem: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z']+|[A-Z]+(?![a-z])|[A-Za-z']+", stem)]


def _wished(stem: str) -> bool:
    return any(len(word) > 2 and wished.startswith(word) for word in _words(stem) for wished in _WISHED.split())


def _means(word: str, part: str) -> bool:
    known = (part, *WORDS.get(part, "").split())
    return word in known or (len(word) > 2 and any(one.startswith(word) for one in known)) or word == part[0]
