"""TDMS: channels in groups; LabVIEW's waveforms have clocks."""

from pathlib import Path
from typing import Any, Final

import numpy as np

from hil.formats.channels import Channel, Heading, Pick, RefusedError, alone, library, numbers, own_names

EXTRA = "tdms"
_UNITS: Final = ("unit_string", "NI_UnitDescription", "Unit", "unit")
_STEP, _START = "wf_increment", "wf_start_time"


def read(path: Path, pick: Pick) -> list[Channel]:
    """The channels of numbers and of times that `pick` takes; waveforms have clocks."""
    nptdms = library("nptdms", EXTRA)
    with alone(path) as content, nptdms.TdmsFile.open(content) as file:
        if file.file_status.incomplete_final_segment:
            raise RefusedError("file must be whole; its last segment is cut off")
        every = [(group.name, one) for group in file.groups() for one in group.channels()]
        parts = [(group, one) for group, one in every if len(one) and np.dtype(one.dtype).kind in "iufbM"]
        names = own_names([(group, one.name) for group, one in parts])
        found = {name: (_heading(name, group, one), one) for name, (group, one) in zip(names, parts, strict=True)}
        chosen = [found[name] for name in pick([heading for heading, _ in found.values()]) if name in found]
        starts = [one.properties[_START] for _, one in chosen if _START in one.properties]
        return [_channel(heading, one, min(starts, default=None)) for heading, one in chosen]


def _heading(name: str, group: str, channel: Any) -> Heading:
    unit = next((str(channel.properties[key]) for key in _UNITS if channel.properties.get(key)), "")
    is_time = np.dtype(channel.dtype).kind == "M"
    clocked = bool(channel.properties.get(_STEP))
    return Heading(name, "s" if is_time else unit, group, clocked=clocked, samples=len(channel))


def _channel(heading: Heading, channel: Any, first: Any) -> Channel:
    values = numbers(channel[:])
    if not heading.clocked:
        return Channel(heading, values)
    start = channel.properties.get(_START, first)
    late = (np.datetime64(start) - np.datetime64(first)) / np.timedelta64(1, "s") if first is not None else 0.0
    return Channel(heading, values, np.asarray(channel.time_track(), dtype=float) + float(late))
