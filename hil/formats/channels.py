"""The result of all readers: channels by name, each with its unit and possibly its own clock; and their tables."""

import os
import resource
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from hil.own_process import error_text
from models.files.access import opened
from models.files.csv_reader import MOST_CELLS
from models.records.clock import in_order
from models.rigs.columns import TIME, TIME_SERIES_ROWS

Array = NDArray[np.float64]
_ZEROED: Final = "datetime64[ns]"


@dataclass(frozen=True)
class Heading:
    """A channel of a file; `group`: a topic, a frame or a channel group; `samples`: their number, 0 if unknown."""

    name: str
    unit: str = ""
    group: str = ""
    clocked: bool = False
    samples: int = 0


@dataclass(frozen=True)
class Channel:
    """The samples (n,) of a channel, and their times in s (n,) if it has a clock."""

    heading: Heading
    values: Array
    time_s: Array | None = None


Pick = Callable[[Sequence[Heading]], Collection[str]]
"""From the headings of a file, the names of the channels to read."""
Read = Callable[[Path, Pick], list[Channel]]


@contextmanager
def refusing(path: Path, wanted: str) -> Iterator[None]:
    """Turns any error of a library about the file `path` into a ValueError of one sentence that states the `wanted`."""
    try:
        yield
    except RefusedError as error:
        raise ValueError(f"{path}: {error}") from None
    except Exception as error:
        if type(error) is ValueError and str(error).startswith(str(path)):
            raise
        raise ValueError(f"{path}: file must be {wanted}; got: {error_text(error, 160)}") from None


class RefusedError(ValueError):
    """What is wrong with a file, as one of our own sentences."""


def library(name: str, extra: str) -> Any:
    """The module `name`; if it is not installed, RefusedError names the extra that installs it."""
    try:
        return import_module(name)
    except ImportError:
        needs, install = f"needs the package {name.partition('.')[0]}", f"pip install 'capsule-control[{extra}]'"
        raise RefusedError(f"reading or writing this file {needs}, which is not installed: {install}") from None


@contextmanager
def alone(path: Path) -> Iterator[BinaryIO]:
    """The open record `path`; meanwhile no other file can be opened, so modules must be loaded before."""
    with opened(path, "record") as file:
        fence = os.dup(file.fileno())
        os.close(fence)
        most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (fence, most[1]))
        try:
            yield file
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, most)


def outside(what: str) -> RefusedError:
    """The error of a record with a part, described by `what`, in another file."""
    return RefusedError(f"record must hold all that belongs to it itself; got {what}")


def check_size(samples: Mapping[str, int]) -> None:
    """Refuse channels with too many samples before they fill the memory."""
    for name, count in samples.items():
        if count > TIME_SERIES_ROWS:
            remedy = "cut the file, or sample it more slowly"
            raise RefusedError(f"channel {name} must have at most {TIME_SERIES_ROWS} samples; got {count}: {remedy}")
    if (total := sum(samples.values())) > MOST_CELLS:
        remedy = "take fewer with --rig or --kind, or cut the file"
        raise RefusedError(f"channels must have at most {MOST_CELLS} samples together; got {total}: {remedy}")


def own_names(grouped: Sequence[tuple[str, str]]) -> list[str]:
    """A unique name for each (group, name): the name, preceded by its group if the name is not unique."""
    count = Counter(name for _, name in grouped)
    full = [f"{group}/{name}" if count[name] > 1 and group else name for group, name in grouped]
    again, seen = Counter(full), Counter[str]()
    for k, name in enumerate(full):
        seen[name] += 1
        full[k] = f"{name}#{seen[name]}" if again[name] > 1 else name
    return full


def numbers(values: Any) -> Array:
    """Samples as floats; dates become seconds since the first of them."""
    array = np.asarray(values)
    if array.dtype.kind == "M":
        since = array.astype(_ZEROED)
        return np.asarray((since - since[0]).astype(np.int64) * 1e-9 if since.size else np.empty(0))
    if array.dtype.kind == "m":
        return np.asarray(array.astype("timedelta64[ns]").astype(np.int64) * 1e-9)
    return np.asarray(array, dtype=float)


def by_clock(channels: Sequence[Channel]) -> list[tuple[str, Array, list[Channel]]]:
    """Channels by (group, times (n,)), without `t_s`: it is the clock of channels without one, else their count is."""
    clock = next((channel.values for channel in channels if channel.heading.name == TIME), None)
    found: list[tuple[str, Array, list[Channel]]] = []
    for channel in (channel for channel in channels if channel.heading.name != TIME):
        own = channel.time_s if channel.time_s is not None else clock
        times = own if own is not None else np.arange(len(channel.values), dtype=float)
        for group, other, members in found:
            if group == channel.heading.group and np.array_equal(other, times):
                members.append(channel)
                break
        else:
            found.append((channel.heading.group, times, [channel]))
    return found


def one_table(channels: Sequence[Channel]) -> dict[str, Array]:
    """All channels as columns at the union of their times `t_s`, NaN for missing samples."""
    if all(channel.time_s is None for channel in channels):
        lengths = {channel.heading.name: len(channel.values) for channel in channels}
        if len(set(lengths.values())) > 1:
            raise RefusedError(f"columns must have one length; got {lengths}"[:300])
        return {channel.heading.name: channel.values for channel in channels}
    if any(channel.time_s is None and channel.heading.name != TIME for channel in channels):
        raise RefusedError("columns without a clock must not stand beside channels with one: give --rig or --kind")
    groups = by_clock(channels)
    for _, time_s, (channel, *_) in groups if len(groups) > 1 else ():
        kept, back = in_order(time_s)
        if back or not kept.all():
            row = back[0] if back else int(np.argmin(kept))
            raise RefusedError(
                f"stamps of {channel.heading.name} must rise to stand in one table with other clocks; got"
                f" {time_s[row]:.6g} s at sample {row + 1}: give --rig or --kind, or an OUT that ends in .mf4 or .mcap"
            )
    times = np.unique(np.concatenate([t for _, t, _ in groups])) if len(groups) > 1 else groups[0][1]
    columns = {TIME: times}
    for _, time_s, members in groups:
        at = np.searchsorted(times, time_s) if len(groups) > 1 else slice(None)
        for channel in members:
            column = np.full(times.shape, np.nan)
            column[at] = channel.values
            columns[channel.heading.name] = column
    return columns
