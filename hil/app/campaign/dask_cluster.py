"""The same runs on a Dask cluster: an optional extra."""

import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from threading import Lock
from typing import Any, Final

from hil.app.campaign.series_answers import TEXT
from hil.app.campaign.worker import LONGEST_S, Job, Row, lost, overdue, run_jobs
from hil.app.cluster import ANSWER_S, connected, count_of, packed, same_program
from hil.app.console import note

LOOK_S: Final = 1.0  # between two looks at the cluster
TIMEOUT_S: Final = 60.0  # without a worker, after which a campaign ends
RETRIES: Final = 3  # of a run whose worker is lost
AHEAD: Final = 4  # jobs for each worker that are sent at once
_ONE: Final = Lock()
_KEPT: Final = "finished runs are on file, and the same command goes on from there"


def scheduled(
    parts: Iterable[Sequence[Job]], address: str, timeout_s: float = TIMEOUT_S, limit_s: float = LONGEST_S
) -> Iterator[list[Row]]:
    """The rows of each chunk as it ends, computed by workers of the scheduler at `address`, which need this program
    installed, in this version.

    A chunk whose worker dies goes to another worker. A chunk that has cost as many workers as the scheduler allows is
    done last, one run at a time, and so is one whose worker does not answer within `limit_s` a run; that worker is
    started anew. A run that does so again, or still kills its workers, becomes a row with `error`. Raises ValueError
    where Dask, the scheduler or this program on a worker is missing, and after `timeout_s` without any worker.
    """
    suspects: list[Job] = []
    with connected(address) as client:
        if not same_program(client):
            note(TEXT("dumb"))
        note(TEXT("cluster", address=address, count=count_of(client)))
        for part, rows in _answers(client, parts, address, timeout_s, limit_s):
            if isinstance(rows, int):
                suspects += part
            else:
                yield rows
        for job in suspects:
            for _, rows in _answers(client, [[job]], address, timeout_s, limit_s):
                if isinstance(rows, int):
                    yield [lost(job, rows) if rows else overdue(job, limit_s)]
                else:
                    yield rows


def _answers(
    client: Any, parts: Iterable[Sequence[Job]], address: str, timeout_s: float, limit_s: float
) -> Iterator[tuple[Sequence[Job], list[Row] | int]]:
    """Each chunk as it ends, with its rows or how many workers it has killed; none where one has been silent."""
    from distributed import wait

    waiting, more, flying, seen = iter(parts), True, dict[Any, tuple[float, Sequence[Job]]](), time.monotonic()
    while more or flying:
        workers = count_of(client)
        seen = time.monotonic() if workers else seen
        if time.monotonic() - seen > timeout_s:
            raise ValueError(f"--scheduler must have workers; {address} has named none for {timeout_s:g} s; {_KEPT}")
        while more and len(flying) < AHEAD * max(workers, 1):
            if (part := next(waiting, None)) is None:
                more = False
                break
            ends = time.monotonic() + limit_s * len(part) * (1 + AHEAD)
            flying[client.submit(packed(run_alone, part), retries=RETRIES, pure=False)] = ends, part
        for future in [one for one, (ends, _) in flying.items() if time.monotonic() > ends]:
            note(TEXT("silent"))
            _start_anew(client, future)
            yield flying.pop(future)[1], 0
        if not flying:
            continue
        try:
            for future in wait(list(flying), timeout=LOOK_S, return_when="FIRST_COMPLETED").done:
                rows = _outcome(future)
                yield flying.pop(future)[1], rows
        except TimeoutError:
            continue
        except CancelledError:
            raise ValueError(f"--scheduler must stay until the last run; {address} has gone; {_KEPT}") from None


def _start_anew(client: Any, late: Any) -> None:
    """Give up a chunk, and start its worker anew where a nanny watches it: what it does cannot be interrupted."""
    with suppress(OSError, ValueError, RuntimeError):
        silent = [worker for worker, keys in client.processing().items() if late.key in keys]
        late.cancel()
        client.restart_workers(silent, timeout=ANSWER_S, raise_for_error=False)


def run_alone(jobs: Sequence[Job]) -> list[Row]:
    """One chunk at a time: standard output and the compiled model belong to the worker's process."""
    with _ONE:
        return run_jobs(jobs)


def _outcome(future: Any) -> list[Row] | int:
    """A chunk's rows, or how many workers it has killed. TimeoutError where its worker died with the rows."""
    from distributed import KilledWorker

    try:
        rows: list[Row] = future.result(timeout=ANSWER_S)
    except (TimeoutError, CancelledError):
        raise
    except KilledWorker as error:
        return int(error.allowed_failures) + 1
    # A run's own error is a row; what comes here is a worker that cannot run any.
    except Exception as error:  # noqa: BLE001
        got = f"{type(error).__name__}: {error}"
        raise ValueError(f"--scheduler must have workers with this program installed; one answers {got}") from None
    return rows
