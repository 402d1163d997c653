"""Parquet: columns of a table, with their units in the metadata key `unit`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hil.formats.channels import Channel, Heading, Pick, alone, library, numbers, one_table, outside

EXTRA = "parquet"
_UNIT = b"unit"


def read(path: Path, pick: Pick) -> list[Channel]:
    """The columns of numbers and of times that `pick` takes."""
    parquet, types = library("pyarrow.parquet", EXTRA), library("pyarrow.types", EXTRA)
    with alone(path) as content, parquet.ParquetFile(content) as file:
        _within(file.metadata)
        headings = {
            field.name: Heading(field.name, _unit(field, types), samples=file.metadata.num_rows)
            for field in file.schema_arrow
            if _readable(field, types)
        }
        chosen = [name for name in pick(list(headings.values())) if name in headings]
        table = file.read(columns=chosen)
        columns = [table.column(name) for name in chosen]
        plain = [one.cast("float64") if types.is_decimal(one.type) else one for one in columns]
        return [Channel(headings[name], numbers(one.to_numpy())) for name, one in zip(chosen, plain, strict=True)]


def write(path: Path, channels: Sequence[Channel]) -> None:
    """Write channels as one table with the column `t_s`; missing samples are empty cells."""
    pyarrow, parquet = library("pyarrow", EXTRA), library("pyarrow.parquet", EXTRA)
    columns = one_table(channels)
    arrays = [pyarrow.array(values, from_pandas=True) for values in columns.values()]
    units = {"t_s": "s", **{channel.heading.name: channel.heading.unit for channel in channels}}
    fields = [
        pyarrow.field(name, array.type, metadata={_UNIT: units[name].encode()} if units[name] else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), path)


def _within(metadata: Any) -> None:
    """Refuse a table with columns in another file."""
    for group in map(metadata.row_group, range(metadata.num_row_groups)):
        for column in map(group.column, range(group.num_columns)):
            if column.file_path:
                raise outside(f"the column {column.path_in_schema} in the file {column.file_path}")


def _readable(field: Any, types: Any) -> bool:
    kinds = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal, types.is_timestamp)
    return any(kind(field.type) for kind in (*kinds, types.is_duration))


def _unit(field: Any, types: Any) -> str:
    if types.is_timestamp(field.type) or types.is_duration(field.type):
        return "s"
    return str((field.metadata or {}).get(_UNIT, b"").decode("utf-8", "replace"))
