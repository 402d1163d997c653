"""The rows of a campaign as Parquet: one schema for all campaigns."""

import json
from collections.abc import Iterable
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any, Final

from hil.app.campaign.file import METRICS
from hil.app.campaign.page import Row, unsafe
from hil.app.campaign.series_answers import TEXT
from hil.app.console import note
from models.words.quantities import plain

_TEXTS: Final = ("run", "version", "error", "cause", "verdict", "point")
_BATCH: Final = 10_000  # rows that are held at once


def write_table(path: Path, rows: Iterable[Row]) -> str:
    """Write the rows; the file's name, "" where pyarrow is missing. `point` is JSON; the numbers of `Score` are empty
    in the rows of series, and `verdict` in those of loops.
    """
    if find_spec("pyarrow") is None:
        note(TEXT("no_table", path=str(path)))
        return ""
    import pyarrow
    import pyarrow.parquet

    kinds = dict.fromkeys(_TEXTS, pyarrow.string()) | {"seed": pyarrow.int64(), "unsafe": pyarrow.bool_()}
    schema = pyarrow.schema(kinds | dict.fromkeys(("seconds", *METRICS), pyarrow.float64()))
    draft = path.with_name(f".{path.name}.part")
    try:
        with pyarrow.parquet.ParquetWriter(draft, schema, compression="zstd") as writer:
            cells = map(_cells, rows)
            while batch := list(islice(cells, _BATCH)):
                writer.write_table(pyarrow.Table.from_pylist(batch, schema))
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
    return str(path)


def _cells(row: Row) -> dict[str, Any]:
    result = row.get("result", {})
    numbers = {name: value for name in METRICS if isinstance(value := result.get(name), int | float)}
    texts = {name: row.get(name) for name in ("version", "error", "cause")} | {"verdict": result.get("verdict")}
    point = json.dumps(plain(dict(row["point"])))
    own = {"run": str(row["run"]), "seed": row["seed"], "seconds": row.get("seconds"), "point": point}
    return own | texts | {"unsafe": unsafe(row)} | numbers
