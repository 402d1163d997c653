"""The results of a campaign, a line of JSON for each run, and the runs that are still missing."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from hil.app.campaign.dask_cluster import scheduled
from hil.app.campaign.worker import Job, Row, pooled
from hil.app.console import InterruptionError, output_to_notes, progress_bar
from models.words.quantities import plain

Key = int | str


@dataclass(frozen=True)
class Workers:
    """The workers: so many processes (None: one a core), or the cluster of a scheduler. Raises ValueError."""

    processes: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.processes is not None and not 1 <= self.processes <= 1024:
            raise ValueError(f"--workers must lie in [1, 1024]; got {self.processes}")
        if self.processes is not None and self.scheduler is not None:
            raise ValueError(
                f"--workers must be left out with --scheduler, whose cluster has its own; got {self.processes}"
            )

    def rows(self, parts: Sequence[Sequence[Job]]) -> Iterator[list[Row]]:
        """The rows of each chunk as it ends."""
        if not parts:
            return iter(())
        if self.scheduler is not None:
            return scheduled(parts, self.scheduler)
        return pooled(parts, min(self.processes or os.cpu_count() or 1, len(parts)))


def run_missing(
    title: str,
    jobs: Sequence[Job],
    results: Results,
    chunk: int,
    workers: Workers,
    said: Callable[[Row], str] = lambda _: "runs",
) -> list[Row]:
    """Do the jobs that `results` does not hold, `chunk` at a time; the rows of all, in their order. `said` words a new
    row for the progress. Raises InterruptionError, which says what is on file.
    """
    missing = [which for which, job in enumerate(jobs) if job.number not in results.done]
    over = len(jobs) - len(missing)
    parts = [tuple(jobs[which] for which in part) for part in chunks(missing, chunk)]
    try:
        with output_to_notes(), progress_bar(title, even=True) as report:
            for rows in workers.rows(parts):
                results.add(rows)
                over += len(rows)
                report(said(rows[-1]), over / len(jobs))
    except KeyboardInterrupt as error:
        there = sum(job.number in results.done for job in jobs)
        kept = f"{there} of {len(jobs)} runs are on file in {results.path}"
        raise InterruptionError(f"interrupted: {kept}; the same command goes on from there") from error
    return [results.done[job.number] for job in jobs]


class Results:
    """The file `path`, whose runs are `done`. A line that a kill cut off is removed when the file is opened again.

    The key `run` of a row, a number or a word, identifies the run. One process at a time holds the file. Raises
    ValueError for the results of another campaign.
    """

    def __init__(self, path: Path, fingerprint: str) -> None:
        self.path = path
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.done = self._read(fingerprint)
        except BlockingIOError:
            os.close(self._file)
            raise ValueError(
                f"{path}: results must be written by one process at a time; another one holds them"
            ) from None
        except ValueError:
            os.close(self._file)
            raise

    def _read(self, fingerprint: str) -> dict[Key, dict[str, Any]]:
        content = self.path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole != len(content):
            os.ftruncate(self._file, whole)
        lines = content[:whole].splitlines()
        if not lines:
            self._append([{"campaign": fingerprint}])
            return {}
        try:
            head, *rows = [json.loads(line) for line in lines]
            got = head["campaign"]
            done = {_key(row): row for row in rows}
        except (ValueError, KeyError, TypeError):
            raise ValueError(f"{self.path}: results must be lines of JSON that a campaign wrote; got others") from None
        if got != fingerprint:
            raise ValueError(
                f"{self.path}: results must be those of this campaign ({fingerprint}); got {got}: the campaign or its"
                " scenario has changed, so take another --out"
            )
        return done

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Append the rows of a chunk in one write, without runs that are there already."""
        fresh = {_key(row): dict(row) for row in rows if _key(row) not in self.done}
        self._append(fresh.values())
        self.done |= fresh

    def _append(self, rows: Iterable[Mapping[str, Any]]) -> None:
        data = "".join(json.dumps(plain(dict(row)), allow_nan=False) + "\n" for row in rows).encode()
        while data:
            data = data[os.write(self._file, data) :]

    def close(self) -> None:
        """Close the file, as the end of a `with` does."""
        os.close(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _key(row: Mapping[str, Any]) -> Key:
    key = row["run"]
    if not isinstance(key, Key):
        raise TypeError(key)
    return key


def chunks(missing: Iterable[int], size: int) -> list[tuple[int, ...]]:
    """Runs in parts of at most `size`, in order."""
    numbers = list(missing)
    return [tuple(numbers[k : k + size]) for k in range(0, len(numbers), size)]
