"""A rig file in which every key that its kind may have stands with unit, range and meaning, from the schema that checks
it; and a template record of each kind of rig, simulated.
"""

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from hil.app.docs.keys import span, unit_of
from models.identification.kinds import kind_for
from models.records.record import Record, read_record
from models.rigs.kind import Record as Columns
from models.rigs.kind import RigKind, Tables
from models.rigs.reader import parse_rig
from models.rigs.schema import Table, field_of
from models.rigs.tables import Noise
from plant.experiments.series import make_series

_SECONDS: Final = 12.0  # of a template record


def template(kind: RigKind, *, rotary: bool = False) -> tuple[Tables, Columns]:
    """Tables of a rig file of `kind` (with `rotary` of one that turns) and the columns of a simulated record of such a
    rig, the same at every call: from the plant, with numbers that differ from the nominal ones and noise, 100 rows a
    second; or as the kind declares it, measured columns that it leaves out as its nominal model gives them.
    """
    made = kind.turning_template if rotary else kind.template
    if made is None:
        with TemporaryDirectory() as name:
            folder = make_series(kind.id, None, 1, Path(name), _SECONDS)
            stated = tomllib.loads((folder / "rig.toml").read_text(encoding="utf-8"))
            return stated, read_record(folder / "train_1.csv.gz", parse_rig(stated)).columns
    rng = np.random.default_rng(1)
    tables, columns = made(rng)
    blank = {name: np.ones(len(next(iter(columns.values())))) for name in kind.columns(columns).measured}
    if blank.keys() <= columns.keys():
        return tables, columns
    model = kind_for(parse_rig(tables), [])
    return tables, model.imitate(Record("template", kind.id, {**columns, **blank}), model.nominal(), rng).columns


def commented(kind: RigKind, values: Tables, columns: Sequence[str]) -> str:
    """The text of a rig file of `kind` with `values` by table and key, for records with `columns`; a key without a
    value stands as a comment, and so does a table that a rig may do without.
    """
    lines = [f"# A rig of kind {kind.id}: what you believe about it, in SI units. Put your values in place of these."]
    lines += ["", "[rig]", f'kind = "{kind.id}"']
    lines += [_line(key, kind.head, values["rig"]) for key in kind.head.model_fields if key != "kind"]
    for name, table in kind.tables.items():
        lines += ["", f"[{name}]", *(_line(key, table, values.get(name, {})) for key in table.of(columns))]
    measured = kind.columns(columns).measured
    stated = [key for key in Noise.model_fields if any(key.partition("_std_")[0] in column for column in measured)]
    lines += ["", "[noise]", *(_line(key, Noise, values.get("noise", {})) for key in stated)]
    within = {} if kind.instead is None else {f"rig.{kind.instead.name}": kind.instead.table}
    for name, table in {**within, **kind.further}.items():
        lines += ["", f"# [{name}]  {table.purpose}", *(_line(key, table, {}) for key in table.model_fields)]
    return "\n".join([*lines, ""])


def _line(key: str, table: type[Table], values: Mapping[str, Any]) -> str:
    told = f"{key} = {_value(values[key])}" if key in values else f"# {key} ="
    schema = table.model_json_schema()["properties"][key]
    facts = [unit_of(key), span(schema).replace("`", ""), (field_of(table, key).description or "").replace("`", "")]
    return f"{told:<44} # {'; '.join(fact for fact in facts if fact)}" if any(facts) else told


def _value(value: Any) -> str:
    return repr(value) if isinstance(value, float) else json.dumps(value)
