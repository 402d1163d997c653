"""The results of a campaign: one line of JSON a run, appended as they come, whole whenever it is killed."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from hil.app.console import plain

Key = int | str


class Results:
    """The file `path`. What a kill cut off within a line is removed when it is opened again; runs that stand in it are
    `done`.

    A run is known by what its row says under `run`, a number or a word. One process at a time holds the file. Raises
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
        """Append the rows of a chunk in one write; runs that are there already are left out."""
        fresh = {_key(row): dict(row) for row in rows if _key(row) not in self.done}
        self._append(fresh.values())
        self.done |= fresh

    def _append(self, rows: Iterable[Mapping[str, Any]]) -> None:
        data = "".join(json.dumps(plain(dict(row)), allow_nan=False) + "\n" for row in rows).encode()
        while data:
            data = data[os.write(self._file, data) :]

    def close(self) -> None:
        """Let go of the file."""
        os.close(self._file)


def _key(row: Mapping[str, Any]) -> Key:
    key = row["run"]
    if not isinstance(key, Key):
        raise TypeError(key)
    return key


def chunks(missing: Iterable[int], size: int) -> list[tuple[int, ...]]:
    """Runs in parts of at most `size`, in order."""
    numbers = list(missing)
    return [tuple(numbers[k : k + size]) for k in range(0, len(numbers), size)]
