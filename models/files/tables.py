"""Frozen dataclasses from TOML tables: unknown keys, missing ones and wrong types refused in one sentence each."""

from __future__ import annotations

import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, TypeVar

from models.laws.geometry import contact_angle_deg
from models.parameter import nearest

Table = Mapping[str, Any]
R = TypeVar("R")


def from_table(cls: type[R], table: Table, where: str, skip: tuple[str, ...] = ()) -> R:
    """An instance of the frozen dataclass `cls` from a TOML table, its fields being the known keys.

    Raises `ValueError` for an unknown key, naming the nearest, for a missing one, and for a value of another type;
    `where` is the table's name.
    """
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
    for name, f in known.items():
        if name not in values and f.default is MISSING and f.default_factory is MISSING:
            raise ValueError(f"[{where}] must have {name}; got {', '.join(table) or 'nothing'}")
    return cls(**values)


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
            raise ValueError(f"{where} must be a list of numbers; got {value!r}")
        return tuple(converted(item, float, where) for item in value)
    if isinstance(hint, type) and is_dataclass(hint):
        return from_table(hint, value, where)
    fits = (
        isinstance(value, bool)
        if hint is bool
        else isinstance(value, (int, float) if hint is float else hint) and not isinstance(value, bool)
    )
    if not fits or (hint is float and not abs(value) < float("inf")):
        raise ValueError(f"{where} must be a {'finite number' if hint is float else hint.__name__}; got {value!r}")
    return hint(value)


def choice(table: Table, where: str, choices: tuple[str, ...]) -> str:
    """The key at the end of `where`, one of `choices`, else `ValueError` with the nearest."""
    given = table.get(where.rpartition(".")[2])
    if given not in choices:
        raise ValueError(
            f"{where} must be one of {', '.join(choices)}; got {given!r}"
            + (f"; {nearest(given, choices)}" if isinstance(given, str) else "")
        )
    return str(given)
