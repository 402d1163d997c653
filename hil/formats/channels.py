"""What every reader of another's file gives: channels by name, each with its unit and perhaps a clock of its own."""

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

from models.files.access import opened
from models.files.csv_reader import MOST_CELLS
from models.rigs.columns import TIME_SERIES_ROWS

Array = NDArray[np.float64]
_ZEROED: Final = "datetime64[ns]"


@dataclass(frozen=True)
class Heading:
    """A channel that a file has; `group`: a topic, a frame, a channel group; `samples`: where that is known."""

    name: str
    unit: str = ""
    group: str = ""
    clocked: bool = False
    samples: int = 0


@dataclass(frozen=True)
class Channel:
    """The samples (n,) of a channel, and their times in s (n,) where it is clocked."""

    heading: Heading
    values: Array
    time_s: Array | None = None


Pick = Callable[[Sequence[Heading]], Collection[str]]
"""Given what a file has, the names of the channels to read."""
Read = Callable[[Path, Pick], list[Channel]]


@contextmanager
def refusing(path: Path, wanted: str) -> Iterator[None]:
    """Within it, whatever a library says of the file `path` is a ValueError of one sentence, with what is `wanted`."""
    try:
        yield
    except RefusedError as error:
        raise ValueError(f"{path}: {error}") from None
    except Exception as error:
        if type(error) is ValueError and str(error).startswith(str(path)):
            raise
        words = " ".join(str(error).split())[:160] or type(error).__name__
        raise ValueError(f"{path}: file must be {wanted}; got: {words}") from None


class RefusedError(ValueError):
    """What is wrong with a file, in words of ours."""


def library(name: str, extra: str) -> Any:
    """The module `name`; where it is not installed, RefusedError names the extra that brings it."""
    try:
        return import_module(name)
    except ImportError:
        raise RefusedError(
            f"reading or writing this file needs the package {name.partition('.')[0]}, which is not installed: pip"
            f" install 'capsule-control[{extra}]'"
        ) from None


@contextmanager
def alone(path: Path) -> Iterator[BinaryIO]:
    """The record `path`, open; within it no further file can be opened. Modules must be loaded before."""
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
    """What is said of a record of which a part is elsewhere: `what` says which, and where."""
    return RefusedError(f"record must hold all that belongs to it itself; got {what}")


def check_size(samples: Mapping[str, int]) -> None:
    """Refuse channels with too many samples before they fill the memory."""
    for name, count in samples.items():
        if count > TIME_SERIES_ROWS:
            raise RefusedError(
                f"channel {name} must have at most {TIME_SERIES_ROWS} samples; got {count}: cut the file, or sample it"
                " more slowly"
            )
    if sum(samples.values()) > MOST_CELLS:
        raise RefusedError(
            f"channels must have at most {MOST_CELLS} samples together; got {sum(samples.values())}: take fewer with"
            " --rig or --kind, or cut the file"
        )


def own_names(grouped: Sequence[tuple[str, str]]) -> list[str]:
    """A name of its own for each (group, name): the name, with its group before it where others have it, too."""
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
