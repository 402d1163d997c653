"""Independent work side by side: in worker processes, one thread each."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from signal import SIG_DFL, SIGINT, signal
from threading import Thread
from typing import Any, TypeVar

_T = TypeVar("_T")
_R = TypeVar("_R")
_FORKS = sys.platform == "linux"  # elsewhere a forked process may not use what its parent had loaded
_INHERITED: dict[str, Any] = {}  # in a worker: the function and its items


def end_with_parent() -> None:
    """End this process when its parent ends, also when the parent was killed."""

    def watch() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=watch, daemon=True).start()


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if _FORKS else os.cpu_count() or 1


Mapper = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]
_WHERE: list[tuple[int, Mapper | None]] = []  # the innermost `working`


@contextmanager
def working(count: int, mapper: Mapper | None = None) -> Iterator[None]:
    """Within it `each` has so many workers: processes, or those of a `mapper`, which gets what `each` gets."""
    _WHERE.append((count, mapper))
    try:
        yield
    finally:
        _WHERE.pop()


def worker_count() -> int:
    """How many workers `each` has."""
    return _WHERE[-1][0] if _WHERE else cores()


def each(function: Callable[[_T], _R], items: Sequence[_T]) -> list[_R]:
    """`function` of every item, in order: in as many workers as there are processors (or `working` says), which inherit
    all that is in memory and send their results back; in threads where processes cannot be forked. A process that is
    itself a worker has none: its parent keeps the other processors busy.
    """
    if _WHERE and len(items) > 1 and (mapper := _WHERE[-1][1]) is not None:
        return mapper(function, items)
    count = min(worker_count(), len(items))
    if count < 2 or parent_process() is not None:
        return [function(item) for item in items]
    if not _FORKS:
        with ThreadPoolExecutor(count) as threads:
            return list(threads.map(function, items))
    with ProcessPoolExecutor(count, get_context("fork"), _begin, (function, items)) as workers:
        return list(workers.map(_one, range(len(items))))


def _begin(function: Callable[[Any], Any], items: Sequence[Any]) -> None:
    """What a forked worker inherits, nothing of it copied. An interrupt ends it as its parent."""
    _INHERITED.update(function=function, items=items)
    signal(SIGINT, SIG_DFL)
    end_with_parent()


def _one(number: int) -> Any:
    return _INHERITED["function"](_INHERITED["items"][number])
