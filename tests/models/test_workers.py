"""Work in worker processes: its order, its errors, and its end whatever ends."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import parent_process
from pathlib import Path

import numpy as np
import pytest

from models import workers
from models.workers import cores, each

SOON_S = 20.0


@pytest.fixture(autouse=True)
def _two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two workers at least, also on a machine with one processor."""
    monkeypatch.setattr(workers, "cores", lambda: max(2, cores()))


def test_results_are_in_the_order_of_the_items_whoever_is_first() -> None:
    def late(k: int) -> tuple[int, int]:
        time.sleep(0.02 * (5 - k) if k < 5 else 0.0)
        return k, os.getpid()

    found = each(late, range(20))
    assert [k for k, _ in found] == list(range(20))
    assert os.getpid() not in {pid for _, pid in found}
    assert len({pid for _, pid in found}) > 1


def test_workers_see_what_is_in_memory_and_change_nothing_of_it() -> None:
    rows, seen = np.arange(1e6), [0]

    def total(k: int) -> float:
        seen[0] += 1
        return float(rows[k:].sum())

    assert each(total, [0, 999_999]) == [rows.sum(), 999_999.0]
    assert seen == [0]


@pytest.mark.parametrize("items", [[], [3]])
def test_one_item_or_none_needs_no_worker(items: list[int]) -> None:
    assert each(lambda k: (k, os.getpid()), items) == [(k, os.getpid()) for k in items]


def test_an_error_is_raised_as_it_was_and_the_next_call_works() -> None:
    def refused(k: int) -> int:
        if k == 3:
            raise ValueError(f"k must be another; got {k}")
        return k

    with pytest.raises(ValueError, match="k must be another; got 3"):
        each(refused, range(8))
    assert each(lambda k: 2 * k, range(8)) == list(range(0, 16, 2))


def test_a_worker_has_no_workers_and_each_call_its_own_function() -> None:
    def inner(k: int) -> tuple[int, list[int]]:
        return k, [*each(lambda j: 10 * k + j, range(3)), os.getpid()]

    for k, (number, (*values, pid)) in enumerate(each(inner, range(6))):
        assert (number, values) == (k, [10 * k, 10 * k + 1, 10 * k + 2])
        assert pid != os.getpid()
    parents = each(lambda k: each(lambda j: os.getpid(), range(3)), range(2))
    assert all(len(set(pids)) == 1 for pids in parents)


@pytest.mark.parametrize("forks", [True, False])
def test_calls_of_two_threads_do_not_mix(forks: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "_FORKS", forks)
    found: dict[int, list[int]] = {}

    def late(k: int) -> int:
        time.sleep(0.002)
        return k

    def called(factor: int) -> None:
        for _ in range(5):
            found[factor] = each(lambda k: late(factor * k), range(12))

    threads = [threading.Thread(target=called, args=(factor,)) for factor in (1, 1000)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(SOON_S)
    assert found == {factor: [factor * k for k in range(12)] for factor in (1, 1000)}


def test_where_no_process_can_be_forked_calls_within_calls_work_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "_FORKS", False)
    found = each(lambda k: (os.getpid(), each(lambda j: 10 * k + j, range(3))), range(6))
    assert found == [(os.getpid(), [10 * k, 10 * k + 1, 10 * k + 2]) for k in range(6)]


def test_a_killed_worker_is_an_error_and_no_hang() -> None:
    def killed(k: int) -> int:
        if k == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    began = time.monotonic()
    with pytest.raises(BrokenProcessPool):
        each(killed, range(6))
    assert time.monotonic() - began < SOON_S
    assert each(lambda k: k, range(4)) == [0, 1, 2, 3]


def test_no_worker_is_left_when_the_call_ends() -> None:
    pids = set(each(lambda k: os.getpid(), range(8)))
    assert not [pid for pid in pids if _alive(pid)]
    assert parent_process() is None


_FOREVER = """
import os, signal, time
from models import workers
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background inherits an ignored one
workers.cores = lambda: 2

def forever(k):
    os.write(1, b"%d\\n" % os.getpid())
    time.sleep(600)

workers.each(forever, range(4))
"""


@contextmanager
def forever() -> Iterator[tuple[subprocess.Popen[str], list[int]]]:
    """A process in a group of its own whose two workers do not end, and their ids."""
    command, pipe = [sys.executable, "-c", _FOREVER], subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True) as parent:
        try:
            assert parent.stdout is not None
            yield parent, [int(parent.stdout.readline()) for _ in range(2)]
        finally:
            with suppress(ProcessLookupError):
                os.killpg(parent.pid, signal.SIGKILL)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_workers_end_when_their_parent_is_killed(number: signal.Signals) -> None:
    with forever() as (parent, pids):
        assert all(_alive(pid) for pid in pids)
        parent.send_signal(number)
        assert parent.wait(SOON_S) == -number
        ends = time.monotonic() + SOON_S
        while any(_alive(pid) for pid in pids) and time.monotonic() < ends:
            time.sleep(0.02)
        assert not [pid for pid in pids if _alive(pid)]


def test_an_interrupt_ends_parent_and_workers_at_once_and_with_one_traceback() -> None:
    """As Ctrl-C sends it: to the parent and its workers."""
    with forever() as (parent, pids):
        os.killpg(parent.pid, signal.SIGINT)
        _, said = parent.communicate(timeout=SOON_S)
        assert not [pid for pid in pids if _alive(pid)]
    assert "KeyboardInterrupt" in said
    assert "ForkProcess" not in said


def _alive(pid: int) -> bool:
    """Whether the process runs; one that has ended and is not waited for does not."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _counted(log: Path, stop: int = 99) -> list[list[int]]:
    """Three calls of `each`, one with a call within, which write a line an item; an interrupt at item `stop`."""

    def work(k: int) -> int:
        with log.open("a") as file:
            file.write(f"{k}\n")
        if k == stop:
            raise KeyboardInterrupt
        return sum(each(abs, [-k, -1]))

    return [each(work, list(range(first, first + 4))) for first in (0, 4, 8)]


@pytest.mark.parametrize("processes", [1, 2])
def test_interrupted_work_goes_on_from_what_is_kept(tmp_path: Path, processes: int) -> None:
    kept, log = tmp_path / "kept", tmp_path / "log"
    wanted = [[k + 1 for k in range(first, first + 4)] for first in (0, 4, 8)]
    with workers.working(processes):
        with pytest.raises(KeyboardInterrupt), workers.keeping(kept):
            _counted(log, stop=6)
        with kept.open("ab") as file:
            file.write(b"\x80\x04half")
        log.write_text("")
        with workers.keeping(kept) as done:
            assert _counted(log) == wanted
    assert done == 6
    assert sorted(log.read_text().split(), key=int) == [str(k) for k in range(6, 12)]
    assert not kept.exists()
