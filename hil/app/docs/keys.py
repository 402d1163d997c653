"""Every key of the input files with unit, range, default and meaning, read from the schema that checks the files."""

import dataclasses
import math
import typing
from collections.abc import Iterator, Mapping
from typing import Any, Final

from controller.limits import Limits
from controller.registry import CONTROLLERS, ESTIMATORS
from hil.app.docs.meanings import MEANINGS
from hil.app.scenario.bus_scenario import BusTable as SimulatedBusTable
from hil.app.scenario.bus_scenario import FmuTable, JogTable
from hil.app.scenario.deployment import BusTable, ControlTable, ModelTable, Pace, PlantTable
from hil.app.scenario.model_offer import OfferTable
from hil.app.scenario.reference import REFERENCES
from hil.app.scenario.scenario import Control
from hil.drives.cia402.protocol import MODES
from hil.drives.makers import ACTUATORS
from hil.drives.odrive.protocol import FREE_NODES, OdriveTable
from hil.drives.table import HOMES
from hil.formats.table import FORMATS
from hil.nodes.controller.operator import OperatorLimits
from models.files.units import unit_at_end
from models.identification.finding import STAGES
from models.rigs.columns import RANGES, TIME
from models.rigs.kinds import KINDS
from models.rigs.rig import Head
from models.rigs.schema import Table, field_of
from models.rigs.tables import BodyTable, CapsuleTable, Checks, ColumnTable, Noise, TissueTable

_COMMON: Final[Mapping[str, tuple[type[Table], ...]]] = {
    "[noise]": (Noise,),
    "[columns], a column of ours": (ColumnTable,),
    "[checks]": (Checks,),
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
    strict = {name: sorted(dict.fromkeys(tables), key=_free) for name, tables in found.items()}
    return {**{name: tuple(tables) for name, tables in strict.items()}, **_COMMON}


def _free(table: type[Table]) -> int:
    """How many keys may be left out."""
    return sum(not field.is_required() for field in table.model_fields.values())


DEPLOYMENT_TABLES: Final[Mapping[str, Any]] = {
    "[bus]": BusTable,
    "[bus] of a scenario": SimulatedBusTable,
    "[control]": ControlTable,
    "[control] of a scenario": Control,
    **{f'[reference] with kind = "{kind}"': shape for kind, shape in REFERENCES.items()},
    "[limits]": Limits,
    "[model]": ModelTable,
    "[offer]": OfferTable,
    "[operator]": OperatorLimits,
    "[jog] of a scenario": JogTable,
    "[learning]": Pace,
    **{f"[{name}]": table for name, table in ACTUATORS.items()},
    "[plant]": PlantTable,
    "[plant] of a scenario": FmuTable,
}

_WHERE: Final[Mapping[type[Table], str]] = {
    CapsuleTable: "in the gut",
    TissueTable: "in the gut",
    BodyTable: "on a plate",
}
_CHOICES: Final[Mapping[str, tuple[str, ...]]] = {
    "controller": tuple(CONTROLLERS),
    "estimator": ESTIMATORS,
    "stage": STAGES,
    "home": HOMES,
    "mode": tuple(MODES),
}

_NESTED: Final[Mapping[str, str]] = {"options": '`"index.sub" = value`', "endpoints": '`"path" = id`'}
"""Tables within a table, by what stands in a line of them."""

CHECKED: Final[Mapping[tuple[type[Any], str], tuple[float, float]]] = {
    (JogTable, "life_ms"): (1, 200),
    **{
        (cls, field.name): field.metadata["range"]
        for cls in DEPLOYMENT_TABLES.values()
        for field in dataclasses.fields(cls)
        if math.isfinite(field.metadata.get("range", (math.nan,))[0])
    },
}
"""Ranges that a table checks as it is made; the test of the page tries both ends of each."""


def unit_of(key: str) -> str:
    """The unit that a key's name ends in, "" where it has none."""
    return "bit/s" if key.endswith("bitrate") else unit_at_end(key)[1]


def rig_keys() -> str:
    """The tables of a rig file as Markdown."""
    return "\n\n".join(f"### {_head(name)}\n\n{_rows(_pydantic(models))}" for name, models in rig_tables().items())


def deployment_keys() -> str:
    """The tables that a deployment or a scenario has beside those of the rig, as Markdown."""
    return "\n\n".join(f"### {_head(name)}\n\n{_rows(_dataclass(cls))}" for name, cls in DEPLOYMENT_TABLES.items())


def columns() -> str:
    """What a record of each kind of rig must hold, and the ranges of its columns, as Markdown."""
    lines = ["| kind | driven | measured | fewest rows |", "| --- | --- | --- | --- |"]
    held = [(kind, one) for kind in KINDS for one in KINDS[kind].layouts]
    for kind, known in held:
        driven = [f"`{TIME}`"] if known.time else []
        driven += [" or ".join(f"`{name}`" for name in alternatives) for alternatives in known.driven]
        driven += [f"`{name}` (or in the rig file)" for name in known.given_by_rig]
        driven += [f"`{name}` (may be left out)" for name in known.optional]
        measured = ", ".join(f"`{name}`" for name in known.measured)
        lines.append(f"| `{kind}` | {', '.join(driven)} | {measured} | {known.minimum} |")
    lines += ["", "| column | range |", "| --- | --- |"]
    for name, one in RANGES.items():
        relation = ">" if one.above else ">="
        lines.append(f"| `{name}` | {relation} {one.lower:g}, <= {one.upper:g} {unit_of(name)} |".replace("  ", " "))
    return "\n".join(lines)


def formats() -> str:
    """The formats of other programs' files with their endings and extras, as Markdown."""
    lines = ["| format | endings | extra | written, too |", "| --- | --- | --- | --- |"]
    for one in FORMATS:
        endings = ", ".join(f"`{ending}`" for ending in one.endings)
        lines.append(f"| {one.name} | {endings} | `{one.extra}` | {'yes' if one.write else 'no'} |")
    return "\n".join(lines)


def all_keys() -> Iterator[str]:
    """Every key of a deployment or a scenario, which needs a meaning."""
    for cls in DEPLOYMENT_TABLES.values():
        yield from (field.name for field in dataclasses.fields(cls))


def _head(name: str) -> str:
    table, _, rest = name.partition("]")
    return f"`{table}]`{rest}"


def _rows(rows: Iterator[tuple[str, str, str, str, str]]) -> str:
    lines = ["| key | unit | range | default | meaning |", "| --- | --- | --- | --- | --- |"]
    for key, span, default, meaning, source in rows:
        lines.append(f"| `{key}` | {unit_of(key)} | {span} | {default} | {meaning}{source and f' ({source})'} |")
    return "\n".join(lines).replace("|  |", "| |").replace("|  |", "| |")


def _pydantic(models: tuple[type[Table], ...]) -> Iterator[tuple[str, str, str, str, str]]:
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
        yield key, span(schema), said, field_of(models[0], key).description or "", ""


def span(schema: Mapping[str, Any]) -> str:
    """The range or the choices that the JSON schema of a key allows, "" where it is free."""
    inner = next((part for part in schema.get("anyOf", [schema]) if part.get("type") != "null"), schema)
    if "const" in inner or "enum" in inner:
        return " or ".join(f"`{value}`" for value in inner.get("enum", [inner.get("const")]))
    if inner.get("type") == "boolean":
        return "true or false"
    if "minItems" in inner:
        return f"list of {inner['minItems']}, each {span(inner['items'])}"
    bounds = (("exclusiveMinimum", ">"), ("minimum", ">="), ("exclusiveMaximum", "<"), ("maximum", "<="))
    return ", ".join(f"{sign} {inner[name]:g}" for name, sign in bounds if name in inner)


def _dataclass(cls: type[Any]) -> Iterator[tuple[str, str, str, str, str]]:
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        known = Limits.ranges().get(field.name) if cls is Limits else CHECKED.get((cls, field.name))
        if known is not None:
            lower, upper = known
            span = f">= {lower:g}" + (f", <= {upper:g}" if math.isfinite(upper) else "")
        elif field.name in _CHOICES:
            span = ", ".join(f"`{name}`" for name in _CHOICES[field.name])
        elif (cls, field.name) == (OdriveTable, "node_id"):
            span = ", ".join(map(str, FREE_NODES))
        else:
            listed = "list of text" if "str" in str(hints[field.name]) else "list of numbers"
            other = listed if "tuple" in str(hints[field.name]) else ""
            other = _NESTED.get(field.name, other)
            span = {str: "text", float: "number", bool: "true or false"}.get(hints[field.name], other)
        missing = field.default is dataclasses.MISSING
        default, source = "required" if missing else _value(field.default), field.metadata.get("source", "")
        yield field.name, span, default, MEANINGS[field.name], source


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"`{value}`" if value else "empty"
    if isinstance(value, list | tuple):
        return ", ".join(map(_value, value)) or "empty list"
    return f"{value:.9g}"
