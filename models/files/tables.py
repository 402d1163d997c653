"""Frozen dataclasses from TOML tables: unknown keys, missing ones and wrong types refused in one sentence each."""

import sys
import types
import typing
from collections.abc import Collection, Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, Final, TypeVar

from models.files.units import unit, unit_of
from models.laws.geometry import contact_angle_deg
from models.parameter import nearest

Table = Mapping[str, Any]
R = TypeVar("R")
LARGEST_INTEGER: Final = 1 << 63  # what TOML's integers hold
_SMALLEST: Final = 1e-12  # least of a positive number, in SI
# most of a number by its dimension, in SI
_LARGEST: Final = {"m": 1e6, "s": 1e12, "N": 1e6, "m/s": 1e6, "N/m": 1e9, "A": 1e4, "V": 1e6}
_LARGEST_OTHER: Final = 1e15
"""Magnitudes of numbers in a file by what their unit measures, in SI; those of integers such as seeds have none."""
_WANTED: Final[Mapping[type, str]] = {
    bool: "true or false",
    float: "a finite number",
    int: f"an integer within {LARGEST_INTEGER:.0e} either way",
    str: "text",
}


def from_table(cls: type[R], table: Table, where: str, skip: tuple[str, ...] = ()) -> R:
    """An instance of the frozen dataclass `cls` from a TOML table, its fields being the known keys.

    Raises `ValueError` for an unknown key, naming the nearest, for a missing one, and for a value of another type;
    `where` is the table's name.
    """
    if not isinstance(table, Mapping):
        raise ValueError(f"{where} must be a table; got {shown(table)}")
    known = {f.name: f for f in fields(cls) if f.name != "folder"}  # type: ignore[arg-type]
    hints = typing.get_type_hints(cls)
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key in skip:
            continue
        if key not in known:
            raise ValueError(
                f"keys of [{where}] must be among {', '.join(known)}; got {key!r}; {nearest(key, list(known))}"
            )
        values[key] = converted(value, hints[key], f"{where}.{key}")
    missing = [
        name
        for name, f in known.items()
        if name not in values and f.default is MISSING and f.default_factory is MISSING
    ]
    if missing:
        raise ValueError(f"[{where}] must have {', '.join(missing)}; got {', '.join(table) or 'nothing'}")
    built = cls(**values)
    for key, value in values.items():
        check_magnitude(value, f"{where}.{key}")
    return built


def check_word(word: str, where: str, choices: Collection[str]) -> str:
    """The `word` where it is one of the choices, else a ValueError of one sentence with the nearest."""
    if word not in choices:
        known = list(choices)
        raise ValueError(f"{where} must be one of {', '.join(known)}; got {word!r}; {nearest(word, known)}")
    return word


def check_magnitude(value: Any, where: str) -> None:
    """Raises ValueError of one sentence for a number, or one of a list, that nothing in the unit of its key `where` can
    have: whatever a file states is refused there before it reaches a law.
    """
    for number in value if isinstance(value, tuple) else (value,):
        if not isinstance(number, float) or number == 0:
            continue
        found = unit(unit_of(where.rpartition(".")[2]) or "1") or unit("1")
        most = (_LARGEST.get(found.dimension, _LARGEST_OTHER) / found.factor) if found else _LARGEST_OTHER
        least = _SMALLEST / found.factor if found else _SMALLEST
        if not least <= abs(number) <= most:
            raise ValueError(f"{where} must be 0 or {least:g} to {most:g}, positive or negative; got {number:g}")


def with_contact_angle(table: Table, radius_m: float, where: str) -> Table:
    """A table `[tissue]` in which the contact angle stands for the relaxed lumen's diameter, if that is given instead.

    Raises ValueError where both are given, or where a capsule of `radius_m` does not stretch that lumen.
    """
    if "lumen_diameter_m" not in table:
        return table
    if "contact_angle_deg" in table:
        raise ValueError(
            f"[{where}] must have lumen_diameter_m or contact_angle_deg; got both, and each follows from the other"
        )
    diameter = converted(table["lumen_diameter_m"], float, f"{where}.lumen_diameter_m")
    try:
        angle = contact_angle_deg(diameter, radius_m)
    except ValueError as error:
        raise ValueError(f"[{where}] {error}") from None
    return {key: value for key, value in table.items() if key != "lumen_diameter_m"} | {"contact_angle_deg": angle}


def converted(value: Any, hint: Any, where: str) -> Any:
    """`value` as the type `hint` (a number, text, truth value, list of numbers, or coil table), else `ValueError`."""
    if typing.get_origin(hint) is types.UnionType:
        parts = [part for part in typing.get_args(hint) if part is not type(None)]
        hint = next((part for part in parts if type(value) is part), parts[0])
    if typing.get_origin(hint) is typing.Literal:
        choices = typing.get_args(hint)
        if value not in choices:
            raise ValueError(f"{where} must be one of {', '.join(choices)}; got {value!r}")
        return value
    if typing.get_origin(hint) is tuple:
        if not isinstance(value, list):
            words = "text" if typing.get_args(hint)[0] is str else "numbers"
            raise ValueError(f"{where} must be a list of {words}; got {shown(value)}")
        return tuple(converted(item, typing.get_args(hint)[0], where) for item in value)
    if isinstance(hint, type) and is_dataclass(hint):
        return from_table(hint, value, where)
    if hint is bool:
        fits = isinstance(value, bool)
    elif hint is float:
        fits = is_number(value)
    elif hint is int:
        fits = isinstance(value, int) and not isinstance(value, bool) and abs(value) < LARGEST_INTEGER
    else:
        fits = isinstance(value, hint)
    if not fits:
        raise ValueError(f"{where} must be {_WANTED.get(hint, 'a ' + hint.__name__)}; got {shown(value)}")
    return hint(value)


def is_number(value: Any) -> bool:
    """Whether a value of a file is a number that a float can hold; one of 400 digits is not."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def shown(value: Any, most: int = 60) -> str:
    """A value of a file as a sentence tells it: on one line and short."""
    text = " ".join(repr(value).split())
    return text if len(text) <= most else f"{text[:most]}... ({len(text)} characters)"


def choice(table: Table, where: str, choices: tuple[str, ...]) -> str:
    """The key at the end of `where`, one of `choices`, else `ValueError` with the nearest."""
    given = table.get(where.rpartition(".")[2])
    if given not in choices:
        raise ValueError(
            f"{where} must be one of {', '.join(choices)}; got {shown(given)}"
            + (f"; {nearest(given, choices)}" if isinstance(given, str) else "")
        )
    return str(given)
