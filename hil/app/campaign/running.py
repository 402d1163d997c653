"""The results of a campaign, a line of JSON for each run, and the runs that are still missing."""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any, Final, Self, TypeVar

from hil.app.campaign.dask_cluster import scheduled
from hil.app.campaign.series_answers import TEXT
from hil.app.campaign.worker import LONGEST_S, OUTSIDE, PASSING, Job, Row, pooled
from hil.app.cluster import Workers
from hil.app.console import InterruptionError, note, output_to_notes, progress_bar
from models.words.quantities import plain

Key = int | str
K = TypeVar("K", int, str)
SHOWN_S: Final = 30.0  # least time between two pages of a campaign that is under way


def run_missing(
    title: str,
    numbers: Sequence[K],
    job_of: Callable[[K], Job],
    results: Results,
    chunk: int,
    workers: Workers,
    said: Callable[[Row], str] = lambda _: "runs",
    shown: Callable[[], object] = lambda: None,
    keep: Callable[[Row], None] = lambda _: None,
    limit_s: float = LONGEST_S,
) -> None:
    """Do the runs that `results` does not hold, `chunk` at a time. `said` words a new row for the progress, `keep`
    stores the `files` of a row before the row is on file, and `shown` shows what is there so far: it gets a twentieth
    of the time. Raises InterruptionError, which says what is on file.
    """
    missing = [number for number in numbers if number not in results.done]
    over, began, spent = len(numbers) - len(missing), time.monotonic(), 0.0
    shows = began + SHOWN_S
    parts = (tuple(map(job_of, missing[k : k + chunk])) for k in range(0, len(missing), chunk))
    at = workers.scheduler
    done = pooled(parts, workers.count, limit_s) if at is None else scheduled(parts, at, limit_s=limit_s)
    try:
        with output_to_notes(), progress_bar(title, even=True, done=over / max(len(numbers), 1)) as report:
            for rows in done if missing else ():
                spent += sum(row["seconds"] for row in rows)
                if over == len(numbers) - len(missing):
                    _estimate(len(missing), spent / len(rows), min(workers.count, len(missing)))
                for row in rows:
                    keep(row)
                results.add(rows)
                over += len(rows)
                report(said(rows[-1]), over / len(numbers))
                if (now := time.monotonic()) >= shows:
                    shown()
                    shows = time.monotonic() + max(SHOWN_S, 20 * (time.monotonic() - now))
    except KeyboardInterrupt as error:
        kept = f"{over} of {len(numbers)} runs are on file in {results.path}"
        raise InterruptionError(f"interrupted: {kept}; the same command goes on from there") from error


def _estimate(runs: int, each_s: float, workers: int) -> None:
    if not workers:
        note(TEXT("estimate_cluster", runs=runs, seconds=each_s))
    elif runs > workers:
        note(TEXT("estimate", runs=runs, seconds=each_s, workers=workers, total=runs * each_s / workers))


class Results:
    """The file `path`: a line of JSON for each run, by its key `run`, a number or a word. `done` are the places of the
    rows in it. A line that a kill cut off is removed when the file is opened again. Rows of runs that failed for a
    cause outside them do not count, with `retry` neither do those of failed runs and of other programs; `version` is
    that of this program. One process at a time holds the file. Raises ValueError for the results of another campaign,
    or of another program.
    """

    def __init__(self, path: Path, fingerprint: str, version: str = "", *, retry: bool = False) -> None:
        self.path, self._version = path, version
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.done = self._read(fingerprint, retry=retry)
        except BlockingIOError:
            os.close(self._file)
            raise ValueError(
                f"{path}: results must be written by one process at a time; another one holds them"
            ) from None
        except ValueError:
            os.close(self._file)
            raise

    def _read(self, fingerprint: str, *, retry: bool) -> dict[Key, int]:
        self._end = self._cut()
        done, others = dict[Key, int](), Counter[str]()
        try:
            lines = self._lines()
            first = next(lines, None)
            if first is None:
                self._append([{"campaign": fingerprint}])
                return {}
            got = first[1]["campaign"]
            for place, row in lines:
                done.pop(_key(row), None)
                of_another = row.get("version", "") != self._version
                if row.get("cause") == OUTSIDE or (retry and ("error" in row or of_another)):
                    continue
                others[row.get("version", "")] += of_another
                done[_key(row)] = place
        except (ValueError, KeyError, TypeError, AttributeError):
            raise ValueError(f"{self.path}: results must be lines of JSON that a campaign wrote; got others") from None
        if got != fingerprint:
            raise ValueError(
                f"{self.path}: results must be those of this campaign ({fingerprint}); got {got}: the campaign or its"
                " scenario has changed, so take another --out"
            )
        for version, count in others.most_common(1):
            if count:
                by = version or "a program that did not say its version"
                raise ValueError(
                    f"{self.path}: results must be those of this program ({self._version}); got {count} runs of {by}:"
                    " --retry does them again, another --out keeps both"
                )
        return done

    def _cut(self) -> int:
        """The end of the last whole line; what follows it is removed."""
        with self.path.open("rb") as file:
            end = sum(len(line) for line in file if line.endswith(b"\n"))
        if end != self.path.stat().st_size:
            os.ftruncate(self._file, end)
        return end

    def _lines(self) -> Iterator[tuple[int, dict[str, Any]]]:
        with self.path.open("rb") as file:
            place = 0
            for line in file:
                yield place, json.loads(line)
                place += len(line)

    def rows(self) -> Iterator[Row]:
        """The rows that count, one after the other."""
        lines = self._lines()
        next(lines)
        return (row for place, row in lines if self.done.get(_key(row)) == place)

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Append a chunk's rows that are new, in one write. Raises ValueError for a worker with another program."""
        fresh = {_key(row): row for row in rows if _key(row) not in self.done}
        for row in fresh.values():
            if (got := row.get("version", "")) != self._version:
                where = row.get("worker", "one")
                raise ValueError(f"workers must have this program ({self._version}); {where} has {got or 'another'}")
        lasting = [{key: value for key, value in row.items() if key not in PASSING} for row in fresh.values()]
        for key, place in zip(fresh, self._append(lasting), strict=True):
            self.done[key] = place

    def drop(self, key: Key) -> None:
        self.done.pop(key, None)

    def _append(self, rows: Iterable[Mapping[str, Any]]) -> list[int]:
        lines = [json.dumps(plain(dict(row)), allow_nan=False).encode() + b"\n" for row in rows]
        places = list(accumulate(map(len, lines), initial=self._end))
        data = b"".join(lines)
        while data:
            data = data[os.write(self._file, data) :]
        self._end = places.pop()
        return places

    def close(self) -> None:
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
