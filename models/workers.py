"""Independent work side by side: in worker processes, one thread each."""

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Any, TypeVar

_T = TypeVar("_T")
_R = TypeVar("_R")
_FORKS = sys.platform == "linux"  # elsewhere a forked process may not use what its parent had loaded
_SHARED: dict[str, Any] = {}  # what the workers inherit: the function and its items


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


def each(function: Callable[[_T], _R], items: Sequence[_T]) -> list[_R]:
    """`function` of every item, in order: in as many workers as there are processors, which inherit all that is in
    memory and send their results back; in threads where processes cannot be forked. A process that is itself a worker
    has none: its parent keeps the other processors busy.
    """
    count = min(cores(), len(items))
    if count < 2 or parent_process() is not None:
        return [function(item) for item in items]
    _SHARED.update(function=function, items=items)
    try:
        with _executor(count) as workers:
            return list(workers.map(_one, range(len(items))))
    finally:
        _SHARED.clear()


def _executor(count: int) -> Executor:
    if not _FORKS:
        return ThreadPoolExecutor(count)
    return ProcessPoolExecutor(count, get_context("fork"), end_with_parent)


def _one(number: int) -> Any:
    return _SHARED["function"](_SHARED["items"][number])
