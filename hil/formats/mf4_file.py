"""MF4 and older MDF files of measurements: channels in groups, each group with a clock."""

import logging
import mmap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hil.formats.channels import Channel, Heading, Pick, RefusedError, by_clock, library, numbers, outside, own_names
from models.files.access import opened

EXTRA = "mf4"
MOST_CHANNELS = 20_000
_FRAMES = b"CAN_DataFrame"
_TEXT = ("U", "S", "O", "V")
_EMBEDDED = 1  # flag of an attachment inside the file
_NUMBERS_4, _TEXTS_3 = range(6), (7, 8)  # data types: numbers in MDF 4, text and bytes in MDF 3


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    asammdf = library("asammdf", EXTRA)
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with opened(path, "record") as content, asammdf.MDF(content, process_bus_logging=False) as file:
            for one in file.attachments if file.version >= "4.00" else ():
                if not one.flags & _EMBEDDED:
                    raise outside(f"an attachment in the file {one.file_name}")
            yield file


def check_within(path: Path) -> None:
    """Refuse an MF4 file with attachments in other files."""
    with _opened(path):
        pass


def holds_frames(path: Path) -> bool:
    """Whether the file is a log of a CAN bus rather than of channels, by its names. Raises OSError."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return content.find(_FRAMES) >= 0


def read(path: Path, pick: Pick) -> list[Channel]:
    """The channels of numbers that `pick` takes, at the times of their groups' masters."""
    with _opened(path) as file:
        places = [(g, i) for g, group in enumerate(file.groups) for i in range(len(group.channels))]
        places = [(g, i) for g, i in places if i != file.masters_db.get(g) and _readable(file, g, i)]
        if len(places) > MOST_CHANNELS:
            raise RefusedError(f"MF4 file must have at most {MOST_CHANNELS} channels; got {len(places)}")
        names = own_names([(_group(file, g), file.groups[g].channels[i].name) for g, i in places])
        found = {name: (_heading(file, name, g, i), g, i) for name, (g, i) in zip(names, places, strict=True)}
        chosen = [found[name] for name in pick([heading for heading, _, _ in found.values()]) if name in found]
        return [channel for heading, g, i in chosen if (channel := _channel(file, heading, g, i))]


def _readable(file: Any, group: int, index: int) -> bool:
    """Whether a channel is stored as plain numbers."""
    stored = file.groups[group].channels[index].data_type
    return stored in _NUMBERS_4 if file.version >= "4.00" else stored not in _TEXTS_3


def _heading(file: Any, name: str, group: int, index: int) -> Heading:
    unit, samples = file.get_channel_unit(group=group, index=index), file.groups[group].channel_group.cycles_nr
    return Heading(name, unit or "", _group(file, group), clocked=True, samples=int(samples))


def _group(file: Any, number: int) -> str:
    return getattr(file.groups[number].channel_group, "acq_name", "") or f"group {number}"


def _channel(file: Any, heading: Heading, group: int, index: int) -> Channel | None:
    """A channel, NaN where marked invalid, as raw numbers if a conversion makes them text; None for arrays."""
    signal = file.get(group=group, index=index, ignore_invalidation_bits=True)
    if signal.samples.dtype.kind in _TEXT:
        signal = file.get(group=group, index=index, raw=True, ignore_invalidation_bits=True)
    if signal.samples.dtype.kind in _TEXT or signal.samples.ndim != 1:
        return None
    values, invalid = numbers(signal.samples), signal.invalidation_bits
    if invalid is not None:
        values = np.where(np.asarray(invalid, dtype=bool), np.nan, values)
    return Channel(heading, values, np.asarray(signal.timestamps, dtype=float))


def write(path: Path, channels: Sequence[Channel]) -> None:
    """Write channels, one group per group and clock; the clock of columns without one is `t_s`."""
    asammdf = library("asammdf", EXTRA)
    file = asammdf.MDF(version="4.10")
    try:
        for group, time_s, members in by_clock(channels):
            signals = [asammdf.Signal(c.values, time_s, name=c.heading.name, unit=c.heading.unit) for c in members]
            file.append(signals, acq_name=group or None, common_timebase=True)
        file.save(path, overwrite=True)
    finally:
        file.close()
