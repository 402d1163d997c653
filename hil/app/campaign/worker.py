"""What a worker of a campaign does: runs, each of which ends in a row, whatever happens in it."""

import contextlib
import io
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any, Final, Protocol

from hil.app.child_process import end_with_parent
from hil.app.write import file_trouble

TRIES: Final = 3  # pools that a run may cost
Row = dict[str, Any]


class Job(Protocol):
    """One run of a campaign: what it is called in the results, its seed, what sets it apart (`point`)."""

    @property
    def number(self) -> int | str: ...
    @property
    def seed(self) -> int: ...
    @property
    def point(self) -> Mapping[str, Any]: ...

    def result(self) -> Row:
        """What comes of it, as JSON has it; a ValueError of one sentence where it cannot be done."""
        ...


def run_jobs(jobs: Sequence[Job]) -> list[Row]:
    """A chunk of runs, one row each: number, seed, what sets it apart, and the result or an error in words."""
    return [run_job(job) for job in jobs]


def run_job(job: Job) -> Row:
    """One run. One that cannot be done gives a row with `error`."""
    row = _row(job)
    began = time.perf_counter()
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            row["result"] = job.result()
    except Exception as error:  # noqa: BLE001 - one run that fails is a result of the campaign, not its end
        words = file_trouble(error) if isinstance(error, OSError) else " ".join(str(error).split())[:300]
        row["error"] = words if isinstance(error, OSError | ValueError) else f"{type(error).__name__}: {words}"
    row["seconds"] = round(time.perf_counter() - began, 3)
    return row


def pooled(parts: Sequence[Sequence[Job]], workers: int) -> Iterator[list[Row]]:
    """The rows of each chunk as it ends, computed by `workers` processes. Chunks that were under way when a worker died
    are done again, one at a time; one that has cost `TRIES` pools is done run by run, and a run that still kills its
    worker becomes a row with `error`.
    """
    waiting = [(tuple(part), 0) for part in reversed(parts)]
    while waiting:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=end_with_parent) as pool:
            flying: dict[Future[list[Row]], tuple[tuple[Job, ...], int]] = {}
            try:
                while waiting or flying:
                    while (
                        waiting and len(flying) < workers + 1 and not (flying and (_suspect(flying) or waiting[-1][1]))
                    ):
                        part, tries = waiting.pop()
                        flying[pool.submit(run_jobs, part)] = part, tries
                    for future in wait(flying, return_when=FIRST_COMPLETED).done:
                        yield future.result()
                        del flying[future]
            except BrokenProcessPool:
                for part, tries in flying.values():
                    if tries + 1 < TRIES:
                        waiting.append((part, tries + 1))
                    elif len(part) > 1:
                        waiting += [((job,), 1) for job in part]
                    else:
                        yield [lost(part[0], TRIES)]
            except (KeyboardInterrupt, GeneratorExit):
                pool.shutdown(wait=False, cancel_futures=True)
                raise


def _suspect(flying: Mapping[Future[list[Row]], tuple[tuple[Job, ...], int]]) -> bool:
    return any(tries for _, tries in flying.values())


def lost(job: Job, deaths: int) -> Row:
    """The row of a run that has killed so many workers."""
    return _row(job) | {"error": f"its worker died {deaths} times", "seconds": 0.0}


def _row(job: Job) -> Row:
    return {"run": job.number, "seed": job.seed, "point": dict(job.point)}
