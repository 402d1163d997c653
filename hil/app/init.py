"""`capsule init`: a rig file with every key explained, a template record and the command to run."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer

from hil.app.console import TEXT, answer, output_to_notes
from hil.app.shared_options import Json, argument
from hil.app.write import sole_writer, table_text, write_files
from models.files.toml import check_word
from models.identification.kinds import kind_for
from models.records.record import Record
from models.rigs.columns import FURTHER
from models.rigs.kind import Record as Columns
from models.rigs.kind import RigKind, Tables
from models.rigs.kinds import KINDS
from models.rigs.reader import parse_rig
from models.rigs.schema import Table, field_of, key_unit, span
from models.rigs.tables import Noise
from plant.experiments.examples import BELIEVED

RIG, RECORD, NOTE = "rig.toml", "record.csv", "README.md"
_NOTE: Final = Path(__file__).with_name("rig_readme.md.txt")


def init(
    kind: Annotated[str, argument("KIND")],
    folder: Annotated[Path, argument("DIR")],
    rotary: Annotated[bool, typer.Option("--rotary")] = False,
    json_output: Json = False,
) -> None:
    """Write three files, all or none. Raises ValueError for an unknown kind and for a file that exists."""
    check_word(kind, "KIND", KINDS)
    if rotary and KINDS[kind].turning_template is None:
        turning = [name for name, one in KINDS.items() if one.turning_template is not None]
        raise ValueError(f"--rotary must go with KIND {' or '.join(turning)}; got {kind}")
    with sole_writer(folder, "DIR"):
        existing = [name for name in (RIG, RECORD, NOTE) if (folder / name).exists()]
        if existing:
            names = ", ".join((RIG, RECORD, NOTE))
            raise ValueError(f"DIR must not hold {names} yet, as no file is overwritten; got {folder / existing[0]}")
        with output_to_notes():
            tables, columns = template(KINDS[kind], rotary=rotary)
        command = f"capsule close-loop {folder / RECORD} --rig {folder / RIG} --out {folder / 'out'}"
        note = _NOTE.read_text(encoding="utf-8").format(
            kind=kind, columns=", ".join(f"`{name}`" for name in columns), command=command
        )
        files = {RIG: commented(KINDS[kind], tables, list(columns)), RECORD: table_text(columns), NOTE: note}
        write_files({folder / name: text for name, text in files.items()})
    answer(
        json_output,
        {"kind": kind, "files": [str(folder / name) for name in files], "command": command},
        TEXT("init.rig", path=folder / RIG),
        TEXT("init.record", path=folder / RECORD),
        TEXT("init.next", command=command),
    )


_SECONDS: Final = 12.0  # of a template record


def template(kind: RigKind, *, rotary: bool = False) -> tuple[Tables, Columns]:
    """Tables of a rig file of `kind` and the columns of a simulated record, the same at every call. The plant makes
    them, or the kind's own template, with noise and with parameters off their nominal values.
    """
    made = kind.turning_template if rotary else kind.template
    if made is None:
        belief = BELIEVED[kind.id]
        truth, _, record = (np.random.default_rng(child) for child in np.random.SeedSequence(1).spawn(3))
        return belief.tables(), belief.record(belief.truth(truth), record, _SECONDS)
    rng = np.random.default_rng(1)
    tables, columns = made(rng)
    blank = {name: np.ones(len(next(iter(columns.values())))) for name in kind.columns(columns).measured}
    if blank.keys() <= columns.keys():
        return tables, columns
    model = kind_for(parse_rig(tables), [])
    return tables, model.imitate(Record("template", kind.id, {**columns, **blank}), model.nominal(), rng).columns


def commented(kind: RigKind, values: Tables, columns: Sequence[str]) -> str:
    """The text of a rig file; keys without a value and optional tables are comments."""
    lines = [TEXT("init.head", kind=kind.id)]
    lines += ["", "[rig]", f'kind = "{kind.id}"']
    lines += [_line(key, kind.head, values["rig"]) for key in kind.head.model_fields if key != "kind"]
    for name, table in kind.tables.items():
        lines += ["", f"[{name}]", *(_line(key, table, values.get(name, {})) for key in table.of(columns))]
    measured, further = kind.columns(columns).measured, [FURTHER[name].key("std") for name in kind.layout.beside]
    stems = ((key, key.partition("_std_")[0]) for key in Noise.model_fields)
    stated = [key for key, stem in stems if key in further or any(stem in column for column in measured)]
    lines += ["", "[noise]", *(_line(key, Noise, values.get("noise", {})) for key in stated)]
    within = {} if kind.instead is None else {f"rig.{kind.instead.name}": kind.instead.table}
    for name, table in {**within, **kind.further}.items():
        lines += ["", f"# [{name}]  {table.purpose}", *(_line(key, table, {}) for key in table.model_fields)]
    return "\n".join([*lines, ""])


def _line(key: str, table: type[Table], values: Mapping[str, Any]) -> str:
    text = f"{key} = {_value(values[key])}" if key in values else f"# {key} ="
    schema = table.model_json_schema()["properties"][key]
    facts = [key_unit(key), span(schema).replace("`", ""), (field_of(table, key).description or "").replace("`", "")]
    return f"{text:<44} # {'; '.join(fact for fact in facts if fact)}" if any(facts) else text


def _value(value: Any) -> str:
    return repr(value) if isinstance(value, float) else json.dumps(value)
