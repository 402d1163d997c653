"""Every key of the input files with unit, range, default and meaning, read from the schema that checks the files."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, Final

from controller.limits import Limits
from hil.app.scenario.bus_scenario import FmuTable, JogTable, SimulatedBusTable
from hil.app.scenario.deployment_tables import BusTable, ControlTable, LearningTable, PlantTable
from hil.app.scenario.model_use import ModelTable, OfferTable
from hil.app.scenario.reference import REFERENCES
from hil.app.scenario.scenario import Control
from hil.drives.makers import ACTUATORS
from hil.formats.reading import FORMATS
from hil.nodes.operator import OperatorLimits
from models.rigs.columns import LOADS, RANGES, TIME, Columns
from models.rigs.kinds import KINDS
from models.rigs.rig import Head
from models.rigs.schema import NamedTable, Table, field_of, key_unit, span
from models.rigs.tables import BodyTable, CapsuleTable, ChecksTable, ColumnTable, Noise, TissueTable
from tests.hil.app.docs.markdown import markdown

_COMMON: Final[Mapping[str, tuple[type[Table], ...]]] = {
    "[noise]": (Noise,),
    "[columns], a column of ours": (ColumnTable,),
    "[checks]": (ChecksTable,),
}


def rig_tables() -> Mapping[str, tuple[type[Table], ...]]:
    """Tables of a rig file; where several kinds of rig state one table differently, the strictest comes first."""
    found: dict[str, list[type[Table]]] = {f"[{name}]": [] for name in ("capsule", "tissue")}
    for kind in KINDS.values():
        own = [base for base in kind.head.__bases__ if not issubclass(Head, base)]
        found |= {f"[rig] of kind {kind.id}": [base] for base in own}
        if kind.instead is not None:
            where = f"[rig.{kind.instead.name}] of kind {kind.id}, in place of those"
            found[where] = [kind.instead.table]
        for name, table in kind.tables.items():
            found.setdefault(f"[{name}]", []).append(table)
    for name in {name: None for kind in KINDS.values() for name in kind.further}:
        users = [kind for kind in KINDS.values() if name in kind.further]
        if f"[{name}]" not in found:
            *most, last = [kind.id for kind in users]
            found[f"[{name}] of {', '.join(most)} and {last}"] = [users[0].further[name]]
    strict = {name: sorted(dict.fromkeys(tables), key=_optional) for name, tables in found.items()}
    return {**{name: tuple(tables) for name, tables in strict.items()}, **_COMMON}


def _optional(table: type[Table]) -> int:
    """How many keys may be left out."""
    return sum(not field.is_required() for field in table.model_fields.values())


DEPLOYMENT_TABLES: Final[Mapping[str, type[NamedTable]]] = {
    "[bus]": BusTable,
    "[bus] of a scenario": SimulatedBusTable,
    "[control]": ControlTable,
    "[control] of a scenario": Control,
    **{f'[reference] with kind = "{kind}"': shape for kind, shape in REFERENCES.items()},
    "[model]": ModelTable,
    "[offer]": OfferTable,
    "[operator]": OperatorLimits,
    "[jog] of a scenario": JogTable,
    "[learning]": LearningTable,
    **{f"[{name}]": table for name, table in ACTUATORS.items()},
    "[plant]": PlantTable,
    "[plant] of a scenario": FmuTable,
}

_WHERE: Final[Mapping[type[Table], str]] = {
    CapsuleTable: "in the gut",
    TissueTable: "in the gut",
    BodyTable: "on a plate",
}


def rig_keys() -> str:
    """The tables of a rig file as Markdown."""
    return _keys({name: _pydantic(models) for name, models in rig_tables().items()})


def deployment_keys() -> str:
    """The tables that a deployment or a scenario has beside those of the rig, as Markdown."""
    tables = {name: _pydantic((table,)) for name, table in DEPLOYMENT_TABLES.items()} | {"[limits]": _limits()}
    return _keys(tables)


def _keys(tables: Mapping[str, Iterator[tuple[str, str, str, str]]]) -> str:
    heads = (f"`{name.replace(']', ']`', 1)}" for name in tables)
    rows = ([(key, key_unit(key), *told) for key, *told in rows] for rows in tables.values())
    text = markdown("keys.md.j2", tables=dict(zip(heads, rows, strict=True)))
    return text.replace("|  |", "| |").replace("|  |", "| |")


def columns() -> str:
    """What a record of each kind of rig must hold, and the ranges of its columns, as Markdown."""
    layouts = [(kind, one, _driven(one)) for kind in KINDS for one in KINDS[kind].layouts]
    ranges = [(name, one, key_unit(name)) for name, one in RANGES.items()]
    return markdown("columns.md.j2", layouts=layouts, ranges=ranges)


def _driven(known: Columns) -> list[str]:
    driven = [f"`{TIME}`"] if known.time else []
    driven += [" or ".join(f"`{name}`" for name in alternatives) for alternatives in known.driven]
    driven += [f"`{name}` (or in the rig file)" for name in known.given_by_rig]
    own = [f"`{name}` (may be left out)" for name in known.optional if name not in LOADS[2:]]
    return [*driven, *own, *(["logged inputs (below)"] if LOADS[2] in known.optional else [])]


def formats() -> str:
    """The formats of other programs' files with their endings and extras, as Markdown."""
    return markdown("formats.md.j2", formats=FORMATS)


def _pydantic(models: tuple[type[Table], ...]) -> Iterator[tuple[str, str, str, str]]:
    strictest, loosest = models[0].model_json_schema(), models[-1].model_json_schema()
    for key, schema in strictest["properties"].items():
        default = loosest["properties"][key].get("default")
        where = [_WHERE[m] for m in models if m in _WHERE and m.model_fields[key].is_required()]
        if where:
            said = f"required {' and '.join(where)}, else {_value(default)}"
        elif models[0].model_fields[key].is_required():
            said = "required"
        else:
            said = "may be left out" if default is None else _value(default)
        yield key, span(schema) or _free(schema), said, field_of(models[0], key).description or ""


def _free(schema: Mapping[str, Any]) -> str:
    """What a key without a range holds."""
    if schema.get("type") == "array":
        return "list of text" if schema["items"].get("type") == "string" else "list of numbers"
    return {"string": "text", "number": "number"}.get(schema.get("type", ""), "")


def _limits() -> Iterator[tuple[str, str, str, str]]:
    for field in dataclasses.fields(Limits):
        lower, upper = Limits.ranges()[field.name]
        yield field.name, f">= {lower:g}, <= {upper:g}", _value(field.default), field.metadata["meaning"]


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"`{value}`" if value else "empty"
    if isinstance(value, list | tuple):
        return ", ".join(map(_value, value)) or "empty list"
    return f"{value:.9g}"
