"""Tables of a file: keys with range, meaning and example, and sentences for wrong values."""

import math
import typing
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache, partial
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Self, TypeVar

from annotated_types import Ge, Gt, Le, Lt
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    ValidationError,
    create_model,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails
from pydantic_core.core_schema import no_info_after_validator_function

from models.files.toml import INTEGER, LARGEST_INTEGER, check_magnitude, is_number, shown
from models.files.units import unit_at_end, unit_of
from models.parameter import nearest

Positive = Annotated[float, Field(ge=1e-12, lt=1e9)]
NotNegative = Annotated[float, Field(ge=0, lt=1e9)]
Length = Annotated[float, Field(ge=1e-6, le=10)]
Height = Annotated[float, Field(ge=1e-3, le=10)]
Mass = Annotated[float, Field(ge=1e-6, le=1000)]
RecoveryTime = Annotated[float, Field(ge=1e-4, le=100)]
CapsuleMass = Annotated[float, Field(ge=1e-5, le=0.5)]
Friction = Annotated[float, Field(ge=0, le=10)]
Angle = Annotated[float, Field(ge=1, le=89)]
Remanence = Annotated[float, Field(ge=1e-3, le=3)]
Real = Annotated[float, Field(gt=-1e9, lt=1e9)]
Numbers = Annotated[tuple[float, ...], Strict(False)]
Words = Annotated[tuple[str, ...], Strict(False)]


class Table(BaseModel):
    """A table of the file: unknown keys are refused, numbers must be finite and of their own type."""

    purpose: ClassVar[str] = ""
    """The purpose of an optional table."""
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @classmethod
    def of(cls, columns: Collection[str]) -> Sequence[str]:
        """The keys that a rig has whose records hold `columns`."""
        return list(cls.model_fields)

    def check(self) -> None:
        """Raises ValueError of one sentence for values that do not go together."""


T = TypeVar("T", bound=Table)
R = TypeVar("R")


def key(
    meaning: str, default: Any = ..., least: float | None = None, most: float | None = None, *, example: str = ""
) -> Any:
    """A key of a table: its meaning, default (none: it is required), least and most value, and an example as TOML."""
    return Field(default, description=meaning, examples=[example], ge=least, le=most)


def assuming(name: str, table: type[T], given: Mapping[str, Any], **hints: Any) -> type[T]:
    """`table` under another `name`, with the values `given` where a file leaves them out and other `hints` of keys."""
    known = {key: (table.model_fields[key].rebuild_annotation(), value) for key, value in given.items()}
    more = {key: (hint, given.get(key, ...)) for key, hint in hints.items()}
    return create_model(name, __base__=table, **known | more)  # type: ignore[call-overload,no-any-return]


@dataclass(frozen=True, eq=False)
class Among:
    """A word is one of the `choices`, also of those that are added later."""

    choices: Collection[str]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(core), "enum": list(self.choices)}

    def check(self, word: str) -> str:
        """The word, where it is one of them."""
        if word not in self.choices:
            known = list(self.choices)
            raise ValueError(f"must be one of {', '.join(known)}; got {word!r}; {nearest(word, known)}")
        return word


class NamedTable(Table):
    """The table `[where]` of a scenario, a deployment or a campaign. Values that break the declaration of a key or
    `model_post_init` raise ValueError, one sentence with table and key.
    """

    where: ClassVar[str]
    weighed: ClassVar[bool] = True
    """Whether impossible magnitudes are refused when it is made."""

    def __init__(self, /, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise _refused(type(self), values, error) from None
        if self.weighed:
            self.weigh(values)

    def weigh(self, names: Iterable[str]) -> None:
        """Raises ValueError for a number of an impossible magnitude."""
        for name in names:
            check_magnitude(getattr(self, name), f"{self.where}.{name}")

    @classmethod
    def read(cls, tables: Mapping[str, Any]) -> Self:
        """The table among those of a file. Raises ValueError."""
        content = tables.get(cls.where, {})
        if not isinstance(content, Mapping):
            raise ValueError(f"{cls.where} must be a table; got {shown(content)}")
        return cls(**content)

    def but(self, **changed: Any) -> Self:
        """The same with what is `changed`. Raises ValueError."""
        return type(self)(**{**dict(self), **changed})


def from_table(cls: type[R], content: Mapping[str, Any], where: str, skip: Collection[str] = ()) -> R:
    """The frozen dataclass that the table `[where]` describes; its fields are the known keys, except those to `skip`.
    Raises ValueError of one sentence.
    """
    if skip and isinstance(content, Mapping):
        content = {name: value for name, value in content.items() if name not in skip}
    made = _table_of(cls, where).read({where: content})  # type: ignore[arg-type]
    built = cls(**{name: getattr(made, name) for name in content})
    made.weigh(content)
    return built


@cache
def _table_of(cls: type[Any], where: str) -> type[NamedTable]:
    """The table whose keys are the fields of a dataclass."""
    hints = typing.get_type_hints(cls)
    keys: dict[str, Any] = {
        one.name: (
            _from_toml(hints[one.name], f"{where}.{one.name}"),
            ... if one.default is one.default_factory is MISSING else None,
        )
        for one in fields(cls)
        if one.name != "folder"
    }
    made = create_model(cls.__name__, __base__=NamedTable, **keys)
    made.where, made.weighed = where, False
    return made


def _from_toml(hint: Any, where: str) -> Any:
    """The type hint of a key in TOML, where tuples are lists and records are tables."""
    if typing.get_origin(hint) is tuple:
        return Annotated[hint, Strict(False)]
    for part in (hint, *typing.get_args(hint)):
        if is_dataclass(part) and isinstance(part, type):
            return Annotated[Any, BeforeValidator(partial(_record, part, where))]
    return Annotated[int, Field(gt=-LARGEST_INTEGER, lt=LARGEST_INTEGER)] if hint is int else hint


def _record(cls: type[R], where: str, content: Any) -> R:
    return from_table(cls, content, where)


def field_of(table: type[Table], name: str) -> FieldInfo:
    """The declaration of a key that has a description: this table's or one of its bases'."""
    declared = (one.model_fields[name] for one in table.__mro__ if issubclass(one, Table) and name in one.model_fields)
    return next((one for one in declared if one.description), table.model_fields[name])


def key_unit(key: str) -> str:
    """The unit that a key's name ends in, "" where it has none."""
    return "bit/s" if key.endswith("bitrate") else unit_at_end(key)[1]


def span(schema: Mapping[str, Any]) -> str:
    """The range or the choices that the JSON schema of a key allows, "" where it is free."""
    inner = next((part for part in schema.get("anyOf", [schema]) if part.get("type") != "null"), schema)
    if "const" in inner or "enum" in inner:
        words = [f"`{value}`" for value in inner.get("enum", [inner.get("const")])]
        return (" or " if len(words) <= 3 else ", ").join(words)
    if inner.get("type") == "boolean":
        return "true or false"
    if "minItems" in inner:
        return f"list of {inner['minItems']}, each {span(inner['items'])}"
    bounds = (("exclusiveMinimum", ">"), ("minimum", ">="), ("exclusiveMaximum", "<"), ("maximum", "<="))
    return ", ".join(f"{sign} {inner[name]:g}" for name, sign in bounds if name in inner)


def example(table: type[Table], name: str) -> str:
    """A value of a key, as TOML writes it; empty where none is stated."""
    return str((field_of(table, name).examples or [""])[0])


def bounds(table: type[Table], key: str) -> tuple[Ge | Gt | None, Le | Lt | None]:
    """The lower and the upper bound of a key's numbers; None where there is none."""
    found = [*table.model_fields[key].metadata, *_within(table.model_fields[key].annotation)]
    lower = next((one for one in found if isinstance(one, Ge | Gt)), None)
    return lower, next((one for one in found if isinstance(one, Le | Lt)), None)


def _within(hint: Any) -> Iterator[Any]:
    """The metadata of a hint and of its arguments."""
    for mark in getattr(hint, "__metadata__", ()):
        yield from getattr(mark, "metadata", (mark,))
    for part in typing.get_args(hint):
        yield from _within(part)


def range_words(table: type[Table], key: str) -> str:
    """The range of a key in words, with the unit that ends its name; empty where it has none."""
    lower, upper = bounds(table, key)
    unit = f" {unit_of(key).replace('_per_', '/')}" if unit_of(key) else ""
    if isinstance(lower, Ge) and isinstance(upper, Le):
        return f"{lower.ge:g} to {upper.le:g}{unit}"
    low = lower and (f"at least {lower.ge:g}" if isinstance(lower, Ge) else f"more than {lower.gt:g}")
    high = upper and (f"at most {upper.le:g}" if isinstance(upper, Le) else f"less than {upper.lt:g}")
    return " and ".join(word for word in (low, high) if word) + (unit if low or high else "")


def check_range(table: type[Table], key: str, value: float, where: str) -> None:
    """Refuse a number out of the range that a rig file's `table` gives its `key`. Raises ValueError of one sentence."""
    lower, upper = bounds(table, key)
    low = lower is None or (value >= lower.ge if isinstance(lower, Ge) else value > lower.gt)  # type: ignore[operator]
    high = upper is None or (value <= upper.le if isinstance(upper, Le) else value < upper.lt)  # type: ignore[operator]
    if not (low and high):
        raise ValueError(f"{where}.{key} must be {range_words(table, key)}; got {value:g}")


def checked(
    where: str,
    name: str,
    table: type[T],
    content: Mapping[str, Any],
    owners: Mapping[str, str] = MappingProxyType({}),
) -> T:
    """The content of the table `[name]`, else a ValueError of one sentence; `owners` gives the kind of rig of a key."""
    try:
        made = table.model_validate(dict(content))
    except ValidationError as error:
        raise _wrong(where, name, table, content, owners, error) from None
    try:
        made.check()
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    return made


def _wrong(
    where: str,
    name: str,
    table: type[Table],
    content: Mapping[str, Any],
    owners: Mapping[str, str],
    error: ValidationError,
) -> ValueError:
    errors = sorted(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
    first, missing = errors[0], [str(e["loc"][0]) for e in errors if e["type"] == "missing"]
    at = str(first["loc"][0]) if first["loc"] else ""
    if first["type"] == "extra_forbidden":
        free = [other for other in table.model_fields if other not in content] or list(table.model_fields)
        owner = f"{at!r}, which belongs to kind {owners[at]!r}" if at in owners else f"{at!r}; {nearest(at, free)}"
        return ValueError(f"{where}: [{name}] key must be a known one; got {owner}")
    if not missing:
        return ValueError(f"{where}: [{name}] {at} must be {_expected(first, table, at)}; got {shown(first['input'])}")
    wrong = ValueError(f"{where}: {_missing(name, table, missing)}")
    if len(missing) > 1:
        wrong.add_note("\n".join([f"[{name}]", *(f"{one} = {example(table, one)}" for one in missing)]))
    return wrong


def _missing(name: str, table: type[Table], keys: Sequence[str]) -> str:
    """Every key that a table lacks, each with its range and an example."""
    lacking = []
    for one in keys:
        limits = [word for word in (range_words(table, one), f"such as {example(table, one)}") if word]
        lacking.append(f"{one!r} ({'; '.join(limits)})")
    if len(keys) == 1:
        return f"[{name}] must have the key {lacking[0]}; it is missing"
    return f"[{name}] must have the keys {', '.join(lacking)}; they are missing"


def _expected(error: ErrorDetails, table: type[Table], name: str) -> str:
    limits = error.get("ctx", {})
    if error["type"] == "literal_error":
        return f"one of {limits['expected']}"
    if {"gt", "ge", "lt", "le"} & set(limits) and name in table.model_fields:
        return range_words(table, name)
    wanted = {
        "bool_type": "true or false",
        "string_type": "text",
        "int_type": INTEGER,
        "tuple_type": f"a list of {'text' if 'str' in str(table.model_fields[name].annotation) else 'numbers'}",
    }
    return wanted.get(error["type"], "a finite number")


_FIRST = {"extra_forbidden": 0, "missing": 1}
"""Errors that are reported before others."""


def _refused(table: type[NamedTable], content: Mapping[str, Any], error: ValidationError) -> ValueError:
    """What is wrong with the `content` of a table, in one sentence."""
    errors = sorted(error.errors(include_url=False), key=lambda e: _FIRST.get(e["type"], len(_FIRST)))
    first, where = errors[0], table.where
    name = str(first["loc"][0]) if first["loc"] else ""
    if first["type"] == "extra_forbidden":
        known = list(table.model_fields)
        return ValueError(f"keys of [{where}] must be among {', '.join(known)}; got {name!r}; {nearest(name, known)}")
    if first["type"] == "missing":
        lacking = ", ".join(str(e["loc"][0]) for e in errors if e["type"] == "missing")
        return ValueError(f"[{where}] must have {lacking}; got {', '.join(content) or 'nothing'}")
    if first["type"] == "value_error":
        said = str(first["ctx"]["error"])
        return ValueError(said if not name or f"{where}.{name}" in said else f"{where}.{name} {said}")
    got = shown(first["input"])
    if first["type"] in ("less_than", "greater_than"):
        return ValueError(f"{where}.{name} must be {INTEGER}; got {got}")
    if first["type"] == "literal_error":
        choices = first["ctx"]["expected"].replace("'", "").replace(" or ", ", ")
        return ValueError(f"{where}.{name} must be one of {choices}; got {got}")
    if not {"ge", "le"} & set(first.get("ctx", {})):
        return ValueError(f"{where}.{name} must be {_expected(first, table, name)}; got {got}")
    lower, upper = bounds(table, name)
    least: Any = lower.ge if isinstance(lower, Ge) else -math.inf
    must = f"be at least {least:g}" if least else "be zero or more"
    if isinstance(upper, Le):
        must = f"lie in [{least:g}, {upper.le:g}]"
    given = first["input"]
    return ValueError(f"{where}.{name} must {must}; got {f'{given:g}' if is_number(given) else got}")
