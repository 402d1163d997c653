"""The results of a campaign, a line of JSON for each run, and the runs that are still missing."""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from statistics import fmean
from typing import Any, Final, Self, TypeVar

from hil.app.campaign.dask_cluster import scheduled
from hil.app.campaign.series_answers import OUTSIDE, TEXT
from hil.app.campaign.worker import LONGEST_S, PASSING, Job, Row, pooled
from hil.app.cluster import Workers
from hil.app.console import InterruptionError, note, output_to_notes, progress_bar
from hil.app.write import file_trouble
from models.files.access import writing
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
    over, open_, shows = len(numbers) - len(missing), set(missing), time.monotonic() + SHOWN_S
    parts = (tuple(map(job_of, missing[k : k + chunk])) for k in range(0, len(missing), chunk))
    at = workers.scheduler
    done = pooled(parts, workers.count, limit_s) if at is None else scheduled(parts, at, limit_s=limit_s)
    try:
        with output_to_notes(), progress_bar(title, even=True, done=over / max(len(numbers), 1)) as report:
            for rows in done if missing else ():
                _check_answer(rows, open_)
                results.check(rows)
                if over == len(numbers) - len(missing):
                    _estimate(len(missing), rows, min(workers.count, len(missing)))
                for row in rows:
                    keep(row)
                results.add(rows)
                over += len(rows)
                report(said(rows[-1]), over / len(numbers))
                if (now := time.monotonic()) >= shows:
                    try:
                        shown()
                    except OSError as error:
                        note(file_trouble(error))  # the rows are on file, and the last page is written again
                    shows = time.monotonic() + max(SHOWN_S, 20 * (time.monotonic() - now))
        if open_:
            raise ValueError(f"workers must answer with a row of each run; {len(open_)} have none: start it again")
    except KeyboardInterrupt as error:
        kept = f"{over} of {len(numbers)} runs are on file in {results.path}"
        raise InterruptionError(f"interrupted: {kept}; the same command goes on from there") from error


def _check_answer(rows: Any, open_: set[K]) -> None:
    """Take the runs of a worker's `rows` out of the `open_` ones. Raises ValueError where it answers anything else."""
    good = isinstance(rows, list) and rows and all(map(is_row, rows))
    if not good or not open_.issuperset(row["run"] for row in rows) or len({row["run"] for row in rows}) < len(rows):
        raise ValueError(f"workers must answer with rows of their runs; one answers {rows!r}"[:300])
    open_.difference_update(row["run"] for row in rows)


def _estimate(runs: int, first: Sequence[Row], workers: int) -> None:
    """Say how long the missing runs will take, from the first of them; a worker's very first one compiles its model."""
    each_s = fmean(row["seconds"] for row in first[1:] or first)
    if not workers:
        note(TEXT("estimate_cluster", runs=runs, seconds=each_s))
    elif runs > workers:
        note(TEXT("estimate", runs=runs, seconds=each_s, workers=workers, total=runs * each_s / workers))


class Results:
    """The file `path`: a line of JSON for each run, by its key `run`, a number or a word. `done` are the places of the
    rows in it. A line that a kill cut off is removed when the file is opened again; one that is no row is left out.
    Rows of runs that failed for a cause outside them do not count, with `retry` neither do those of failed runs and of
    other programs; `version` is that of this program. One process at a time holds the file. Raises ValueError for the
    results of another campaign, or of another program.
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
        done, others, damaged = dict[Key, int](), Counter[str](), 0
        lines = self._lines()
        _, self._end, head = next(lines, (0, 0, {"campaign": fingerprint}))
        if (got := head.get("campaign") if isinstance(head, dict) else head) != fingerprint:
            raise ValueError(
                f"{self.path}: results must be those of this campaign ({fingerprint}); got {got}: the campaign or its"
                " scenario has changed, so take another --out"
            )
        for place, self._end, row in lines:
            if not is_row(row):
                damaged += 1
                continue
            done.pop(row["run"], None)
            of_another = row.get("version", "") != self._version
            if row.get("cause") == OUTSIDE or (retry and ("error" in row or of_another)):
                continue
            others[row.get("version", "")] += of_another
            done[row["run"]] = place
        if not self._end and not _line({"campaign": fingerprint}).startswith(os.pread(self._file, 100, 0)):
            raise ValueError(f"{self.path}: results must be lines of JSON that a campaign wrote; got others")
        os.ftruncate(self._file, self._end)
        if not self._end:
            self._append([{"campaign": fingerprint}])
        if damaged:
            note(TEXT("damaged", path=str(self.path), count=damaged))
        for version, count in others.most_common(1):
            if count:
                by = version or "a program that did not say its version"
                raise ValueError(
                    f"{self.path}: results must be those of this program ({self._version}); got {count} runs of {by}:"
                    " --retry does them again, another --out keeps both"
                )
        return done

    def _lines(self) -> Iterator[tuple[int, int, Any]]:
        """Beginning, end and content of each whole line; None where it is no JSON."""
        with self.path.open("rb") as file:
            place = 0
            for line in file:
                content = None
                with suppress(ValueError, RecursionError):
                    content = json.loads(line)
                if line.endswith(b"\n"):
                    yield place, place + len(line), content
                place += len(line)

    def rows(self) -> Iterator[Row]:
        """The rows that count, one after the other."""
        return (row for place, _, row in self._lines() if is_row(row) and self.done.get(row["run"]) == place)

    def check(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Raises ValueError for rows of a worker with another program."""
        for row in rows:
            if (got := row.get("version", "")) != self._version:
                where = row.get("worker", "one")
                raise ValueError(f"workers must have this program ({self._version}); {where} has {got or 'another'}")

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Append the rows of a chunk in one write, without runs that are there already."""
        fresh = {row["run"]: row for row in rows if row["run"] not in self.done}
        lasting = [{key: value for key, value in row.items() if key not in PASSING} for row in fresh.values()]
        for key, place in zip(fresh, self._append(lasting), strict=True):
            self.done[key] = place

    def drop(self, key: Key) -> None:
        self.done.pop(key, None)

    def _append(self, rows: Iterable[Mapping[str, Any]]) -> list[int]:
        lines = list(map(_line, rows))
        places = list(accumulate(map(len, lines), initial=self._end))
        data = b"".join(lines)
        with writing(self.path):
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


def _line(row: Mapping[str, Any]) -> bytes:
    return json.dumps(plain(dict(row)), allow_nan=False).encode() + b"\n"


def is_row(row: Any) -> bool:
    """Whether it has what each row has."""
    kinds: dict[str, Any] = {"run": Key, "seed": int, "point": dict, "seconds": int | float}
    if not isinstance(row, dict) or not all(isinstance(row.get(name), kind) for name, kind in kinds.items()):
        return False
    return isinstance(row.get("error"), str) or isinstance(row.get("result"), dict)
