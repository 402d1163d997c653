"""Independent work side by side: in worker processes, one thread each."""

import os
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from pathlib import Path
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
    itself a worker has none: its parent keeps the other processors busy. Within `keeping`, what an interrupted run has
    done already is taken from its file.
    """
    if not _KEPT or parent_process() is not None:
        return list(_results(function, items))
    kept = _KEPT.pop()  # calls within this one are part of it
    try:
        return kept.each(function, items)
    finally:
        _KEPT.append(kept)


def _results(function: Callable[[_T], _R], items: Sequence[_T]) -> Iterator[_R]:
    if _WHERE and len(items) > 1 and (mapper := _WHERE[-1][1]) is not None:
        yield from mapper(function, items)
        return
    count = min(worker_count(), len(items))
    if count < 2 or parent_process() is not None:
        yield from map(function, items)
    elif not _FORKS:
        with ThreadPoolExecutor(count) as threads:
            yield from threads.map(function, items)
    else:
        with ProcessPoolExecutor(count, get_context("fork"), _begin, (function, items)) as workers:
            yield from workers.map(_one, range(len(items)))


class _Kept:
    """Results of `each` in the order of the calls, in the file `path`; a result that is not whole ends it."""

    def __init__(self, path: Path) -> None:
        self._path, self._done, whole = path, list[Any](), 0
        if path.exists():
            with path.open("rb") as file:
                try:
                    while True:
                        self._done.append(pickle.load(file))
                        whole = file.tell()
                except (EOFError, pickle.UnpicklingError):
                    pass
            os.truncate(path, whole)
        self.count = len(self._done)

    def each(self, function: Callable[[_T], _R], items: Sequence[_T]) -> list[_R]:
        done, self._done = self._done[: len(items)], self._done[len(items) :]
        with self._path.open("ab") as file:
            for result in _results(function, items[len(done) :]):
                pickle.dump(result, file)
                file.flush()
                done.append(result)
        return done


_KEPT: list[_Kept] = []


@contextmanager
def keeping(path: Path) -> Iterator[int]:
    """Within it results of `each` are kept in the file `path`, which goes once all is done; an interruption leaves it,
    and the same work, of the same program and inputs, goes on from there. Yields how many results were on file.
    """
    kept = _Kept(path)
    _KEPT.append(kept)
    try:
        yield kept.count
        path.unlink(missing_ok=True)
    finally:
        _KEPT.remove(kept)


def _begin(function: Callable[[Any], Any], items: Sequence[Any]) -> None:
    """What a forked worker inherits, nothing of it copied. An interrupt ends it as its parent."""
    _INHERITED.update(function=function, items=items)
    signal(SIGINT, SIG_DFL)
    end_with_parent()


def _one(number: int) -> Any:
    return _INHERITED["function"](_INHERITED["items"][number])
