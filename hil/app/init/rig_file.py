"""A rig file in which every key that its kind may have stands with unit, range and meaning, from the schema that checks
it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

from hil.app.docs.keys import span, unit_of
from hil.app.docs.meanings import MEANINGS
from models.files.columns import columns_of
from models.files.rig import HEADS
from models.files.rig_tables import (
    Axis,
    BodyTable,
    CapsuleTable,
    Clock,
    Contact,
    Drive,
    Magnets,
    Noise,
    PaperCapsuleTable,
    PaperTissueTable,
    Surface,
    Table,
    TissueTable,
)
from models.identification.kinds.axis.coordinates import LINE, TURN

_IN_GUT: Final[Mapping[str, type[Table]]] = {"capsule": CapsuleTable, "tissue": TissueTable}
_OF_PAPER: Final[Mapping[str, type[Table]]] = {"capsule": PaperCapsuleTable, "tissue": PaperTissueTable}
Tables = Mapping[str, Mapping[str, Any]]
"""Values by table and key."""

_TABLES: Final[Mapping[str, Mapping[str, type[Table]]]] = {
    "pull": _IN_GUT,
    "magnetic": _IN_GUT,
    "coil": _IN_GUT,
    "vibro": {**_IN_GUT, "drive": Drive, "surface": Surface},
    "vibro_table": {"capsule": BodyTable, "drive": Drive, "surface": Surface},
    "axis": {"axis": Axis},
    "periods": _OF_PAPER,
    "friction": {"contact": Contact},
    "dma": {},
}
_OPTIONAL: Final[Mapping[str, Mapping[str, type[Table]]]] = {
    "pull": {"clock": Clock},
    "magnetic": {"rig.magnet": Magnets, "surface": Surface, "clock": Clock},
    "coil": {"surface": Surface, "clock": Clock},
    "vibro": {"clock": Clock},
}
_INSTEAD: Final[Mapping[str, str]] = {
    "rig.magnet": "the magnets by their own numbers, in place of magnet_stiffness_N_per_m and magnet_range_m",
    "surface": "a plate under the capsule, or nothing but air, in place of the gut",
    "clock": "how late the measured columns are stamped",
}


def commented(kind: str, values: Tables, columns: Sequence[str]) -> str:
    """The text of a rig file of `kind` with `values` by table and key, for records with `columns`; a key without a
    value stands as a comment, and so does a table that a rig may do without.
    """
    lines = [f"# A rig of kind {kind}: what you believe about it, in SI units. Put your values in place of these."]
    lines += ["", "[rig]", f'kind = "{kind}"']
    lines += [_line(key, HEADS[kind], values["rig"]) for key in HEADS[kind].model_fields if key != "kind"]
    for name, model in _TABLES[kind].items():
        lines += ["", f"[{name}]", *(_line(key, model, values.get(name, {})) for key in _keys(name, model, columns))]
    measured = columns_of(kind, columns).measured
    stated = [key for key in Noise.model_fields if any(key.partition("_std_")[0] in column for column in measured)]
    lines += ["", "[noise]", *(_line(key, Noise, values.get("noise", {})) for key in stated)]
    for name, model in _OPTIONAL.get(kind, {}).items():
        lines += ["", f"# [{name}]  {_INSTEAD[name]}", *(_line(key, model, {}) for key in model.model_fields)]
    return "\n".join([*lines, ""])


def _keys(table: str, model: type[Table], columns: Sequence[str]) -> Sequence[str]:
    """The keys of a table; of `[axis]` those of one that moves as its records do."""
    if table == "axis":
        return (TURN if TURN.position in columns else LINE).base
    return list(model.model_fields)


def _line(key: str, model: type[Table], values: Mapping[str, Any]) -> str:
    told = f"{key} = {_value(values[key])}" if key in values else f"# {key} ="
    schema = model.model_json_schema()["properties"][key]
    facts = [unit_of(key), span(schema).replace("`", ""), MEANINGS.get(key, "").replace("`", "")]
    return f"{told:<44} # {'; '.join(fact for fact in facts if fact)}" if any(facts) else told


def _value(value: Any) -> str:
    return repr(value) if isinstance(value, float) else json.dumps(value)
