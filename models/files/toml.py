"""TOML that a user wrote: what is wrong with it is refused in one sentence, down to types, words and magnitudes."""

import json
import re
import sys
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TypeVar

from models.files.access import read_text
from models.files.units import unit, unit_of
from models.laws.geometry import contact_angle_deg
from models.parameter import nearest


def beside(file: str, name: str) -> dict[str, Any]:
    """The tables of our own data file `name`, which lies beside the module `file`."""
    return tomllib.loads(Path(file).with_name(name).read_text(encoding="utf-8"))


def toml_text(tables: Mapping[str, Any], path: str = "") -> str:
    """`tables` as TOML that reads back as the same, with bare keys; values may be lists, also of tables."""
    values = {key: value for key, value in tables.items() if not isinstance(value, Mapping)}
    lines = [f"[{path}]"] if path and (values or not tables) else []
    lines += [f"{key} = {_value(value)}" for key, value in values.items()]
    text = "\n".join([*lines, ""]) + "\n" if lines else ""
    within = f"{path}." if path else ""
    return text + "".join(toml_text(table, within + key) for key, table in tables.items() if isinstance(table, Mapping))


def inline_table(table: Mapping[str, Any]) -> str:
    """A table on one line."""
    return "{" + ", ".join(f"{key} = {_value(value)}" for key, value in table.items()) + "}"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return inline_table(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def parse_toml(text: str, what: str) -> dict[str, Any]:
    """The tables of a TOML text. Raises ValueError, which begins with `what`, where it is none."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of more digits than Python reads is a plain ValueError
        comma = _DECIMAL_COMMA.search(text)
        hint = f": {comma[1]},{comma[2]} is {comma[1]}.{comma[2]} with a decimal point" if comma else ""
        raise ValueError(f"{what} must be TOML; got: {' '.join(str(error).split())[:200]}{hint}") from None


@contextmanager
def in_file(path: Path) -> Iterator[None]:
    """Within it, a ValueError begins with `path`."""
    try:
        yield
    except ValueError as error:
        said = str(error).startswith((f"{path}:", f"{path.parent}/"))
        raise ValueError(str(error) if said else f"{path}: {error}") from None


def read_toml(path: Path, what: str) -> tuple[dict[str, Any], str]:
    """The tables of a file and its text. Errors as `read_text`."""
    text = read_text(path, what)
    return parse_toml(text, f"{path}: {what}"), text


_DECIMAL_COMMA: Final = re.compile(r"=\s*([+-]?\d+),(\d+(?:[eE][+-]?\d+)?)\s*(?:[,}#\n]|$)")
Table = Mapping[str, Any]
V = TypeVar("V", int, float)
LARGEST_INTEGER: Final = 1 << 63  # what TOML's integers hold
_SMALLEST: Final = 1e-12  # least of a positive number, in SI
# largest numbers by dimension, in SI; integers such as seeds have none
_LARGEST: Final = {"m": 1e6, "s": 1e12, "N": 1e6, "m/s": 1e6, "N/m": 1e9, "A": 1e4, "V": 1e6}
_LARGEST_OTHER: Final = 1e15
INTEGER: Final = f"an integer within {LARGEST_INTEGER:.0e} either way"


def check_word(word: Any, where: str, choices: Collection[str]) -> str:
    """The `word`. Raises ValueError with the nearest of the choices where it is none of them."""
    known = list(choices)
    if word not in known:
        hint = f"; {nearest(word, known)}" if isinstance(word, str) else ""
        raise ValueError(f"{where} must be one of {', '.join(known)}; got {shown(word)}{hint}")
    return str(word)


def check_known(names: Iterable[str], known: Collection[str], must: str) -> None:
    """Raises ValueError for the first of the `names` that is not `known`: what it `must` be, the nearest one."""
    for name in names:
        if name not in known:
            raise ValueError(f"{must} {', '.join(known)}; got {name!r}; {nearest(str(name), [*known])}")


def check_tables(raw: Table, known: Collection[str], others: Collection[str] = ()) -> None:
    """Raises ValueError for a table that is not `known`, and for what is none; `others` may be lists of tables."""
    for name, table in raw.items():
        if name not in known:
            raise ValueError(f"tables must be among {', '.join(known)}; got [{name}]; {nearest(name, [*known])}")
        if name not in others and not isinstance(table, Mapping):
            raise ValueError(f"{name} must be a table; got {shown(table)}")


def check_magnitude(value: Any, where: str) -> None:
    """Raises ValueError for a number, or one of a list, that is implausible in the unit of its key `where`."""
    for number in value if isinstance(value, tuple) else (value,):
        if not isinstance(number, float) or number == 0:
            continue
        found = unit(unit_of(where.rpartition(".")[2]) or "1") or unit("1")
        most = (_LARGEST.get(found.dimension, _LARGEST_OTHER) / found.factor) if found else _LARGEST_OTHER
        least = _SMALLEST / found.factor if found else _SMALLEST
        if not least <= abs(number) <= most:
            raise ValueError(f"{where} must be 0 or {least:g} to {most:g}, positive or negative; got {number:g}")


def with_contact_angle(table: Table, radius_m: float) -> Table:
    """A table `[tissue]` with the contact angle in place of `lumen_diameter_m`. Raises ValueError where both are given
    or a capsule of `radius_m` does not stretch that lumen.
    """
    if "lumen_diameter_m" not in table:
        return table
    if "contact_angle_deg" in table:
        raise ValueError("[tissue] must have lumen_diameter_m or contact_angle_deg; got both")
    diameter = converted(table["lumen_diameter_m"], float, "tissue.lumen_diameter_m")
    try:
        angle = contact_angle_deg(diameter, radius_m)
    except ValueError as error:
        raise ValueError(f"[tissue] {error}") from None
    return {key: value for key, value in table.items() if key != "lumen_diameter_m"} | {"contact_angle_deg": angle}


def converted(value: Any, kind: type[V], where: str) -> V:
    """`value` as a float or an int. Raises ValueError for anything else."""
    if kind is int:
        fits = isinstance(value, int) and not isinstance(value, bool) and abs(value) < LARGEST_INTEGER
    else:
        fits = is_number(value)
    if not fits:
        raise ValueError(f"{where} must be {INTEGER if kind is int else 'a finite number'}; got {shown(value)}")
    return kind(value)


def list_of_numbers(value: Any, where: str) -> tuple[float, ...]:
    if not isinstance(value, list):
        raise ValueError(f"{where} must be a list of numbers; got {shown(value)}")
    return tuple(converted(item, float, where) for item in value)


def is_number(value: Any) -> bool:
    """Whether a value of a file is a number that a float can hold, unlike one of 400 digits."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def shown(value: Any, most: int = 60) -> str:
    """A value of a file on one short line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= most else f"{text[:most]}... ({len(text)} characters)"
