"""The runs of a campaign that are not on file yet, on processes or a cluster; rows are put on file as they end."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence

from hil.app.campaign.dask_cluster import scheduled
from hil.app.campaign.results import Results, chunks
from hil.app.campaign.worker import Job, Row, pooled
from hil.app.console import InterruptionError, output_to_notes, progress_bar


def check_workers(workers: int | None, scheduler: str | None) -> None:
    """Refuse numbers of processes that cannot be, or any beside a cluster. Raises ValueError."""
    if workers is not None and not 1 <= workers <= 1024:
        raise ValueError(f"--workers must lie in [1, 1024]; got {workers}")
    if workers is not None and scheduler is not None:
        raise ValueError(f"--workers must be left out with --scheduler, whose cluster has its own; got {workers}")


def run_missing(
    title: str,
    jobs: Sequence[Job],
    results: Results,
    chunk: int,
    workers: int | None,
    scheduler: str | None,
    said: Callable[[Row], str] = lambda _: "runs",
) -> list[Row]:
    """Do the jobs that `results` does not hold, `chunk` at a time, on `workers` processes (else one a core) or on the
    cluster of `scheduler`; the rows of all, in their order. `said` is what progress says of a row that has come. Raises
    InterruptionError that says what was kept.
    """
    missing = [which for which, job in enumerate(jobs) if job.number not in results.done]
    over = len(jobs) - len(missing)
    parts = [tuple(jobs[which] for which in part) for part in chunks(missing, chunk)]
    try:
        with output_to_notes(), progress_bar(title, even=True) as report:
            for rows in _ended(parts, workers, scheduler):
                results.add(rows)
                over += len(rows)
                report(said(rows[-1]), over / len(jobs))
    except KeyboardInterrupt as error:
        there = sum(job.number in results.done for job in jobs)
        kept = f"{there} of {len(jobs)} runs are on file in {results.path}"
        raise InterruptionError(f"interrupted: {kept}; the same command goes on from there") from error
    return [results.done[job.number] for job in jobs]


def _ended(parts: Sequence[Sequence[Job]], workers: int | None, scheduler: str | None) -> Iterator[list[Row]]:
    if not parts:
        return iter(())
    if scheduler is not None:
        return scheduled(parts, scheduler)
    return pooled(parts, min(workers or os.cpu_count() or 1, len(parts)))
