"""Everything that a file of any readable kind holds, as it stands: no rig says what its columns mean."""

from pathlib import Path

import numpy as np

from hil.formats.channels import Channel, Heading
from hil.formats.reading import read_channels
from hil.formats.table import format_of
from hil.log.blf_reader import Tell
from hil.log.reader import is_log
from hil.log.record import log_channels
from models.files.csv_reader import read_table
from models.files.units import split_unit


def file_channels(path: Path, tell: Tell | None = None) -> list[Channel]:
    """All channels of numbers of a file; `tell` as `read_frames`. Raises ValueError of one sentence."""
    if is_log(path):
        return log_channels(path, tell)
    channels = (
        read_channels(path, lambda headings: [one.name for one in headings]) if format_of(path) else _csv_channels(path)
    )
    if len(channels) < 2 or not any(len(channel.values) for channel in channels):
        raise ValueError(f"{path}: record must have two columns of numbers or more; got {len(channels)}")
    return channels


def _csv_channels(path: Path) -> list[Channel]:
    """The columns of numbers of a CSV file, unchecked but for its form."""
    table = read_table(path, lambda names, units: ())
    return [
        Channel(Heading(name, table.units.get(name) or split_unit(name)[1]), values)
        for name, values in zip(table.header, table.values.T, strict=True)
        if name and not np.isnan(values).all()
    ]
