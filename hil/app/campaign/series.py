"""Folders of series: `rig.toml` and its records; those whose names begin with `holdout` or `held_out` are held out."""

import contextlib
import hashlib
import io
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hil.app.close_loop import read_series, result_files
from hil.app.console import printable
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.write import write_files
from hil.formats.reading import format_of, is_log
from hil.report.numbers import report_json
from models.effects import Catalogue
from models.files.access import text_of
from models.files.csv_reader import ENDINGS
from models.identification import close

RIG, REPORT = "rig.toml", "report.html"
HELD_OUT: Final = ("holdout", "held_out")
_LONGEST: Final = 200  # bytes of a part of a name
KEPT: Final = (
    "verdict", "effects", "error", "next_experiment", "seconds", "kind", "calibration", "findings", "cannot_show",
    "reasons",
)  # fmt: skip
"""What a row keeps of `report.json`."""


@dataclass(frozen=True)
class Series:
    """One rig's folder: its `name`, its records, the folder `out` for its report, the user's `effects`, the `seed`, and
    as `number` the hash of its place and of everything that its answer depends on, except the program.
    """

    number: str
    name: str
    folder: Path
    train: tuple[Path, ...]
    holdout: tuple[Path, ...]
    out: Path
    effects: tuple[Path, ...] = ()
    seed: int = 0

    @property
    def point(self) -> dict[str, str]:
        return {"series": self.name}

    def result(self) -> dict[str, Any]:
        """`close-loop` on it: the numbers in short, and the report's three `files`. Raises ValueError, OSError."""
        for path in (self.folder / RIG, *self.train, *self.holdout, *self.effects):
            os.close(os.open(path, os.O_RDONLY | os.O_NONBLOCK))
        if not self.train:
            raise ValueError(f"{self.folder}: folder must hold records to fit to beside {RIG}; got none")
        with contextlib.redirect_stderr(io.StringIO()):
            rig = Catalogue.read(self.effects).given_to(read_deployed_rig(self.folder / RIG))
            train, held = read_series(self.train, self.holdout, rig)
            finding, model = close(rig, train, held, lambda *_: None, seed=self.seed)
            files = result_files(finding, model)
        report = report_json(finding)
        return {key: report[key] for key in KEPT} | {"files": files}

    def keep(self, files: Mapping[str, str | bytes]) -> None:
        if files:
            self.out.mkdir(parents=True, exist_ok=True)
            write_files({self.out / name: content for name, content in files.items()})

    @property
    def reported(self) -> bool:
        return (self.out / REPORT).is_file()


def find_series(folders: Sequence[Path], out: Path, effects: Sequence[Path] = (), seed: int = 0) -> list[Series]:
    """The series in the folders and below them, named by their paths from a common folder; reports go to folders of the
    same names in `out`. Raises ValueError where a folder has none.
    """
    found: set[Path] = set()
    for folder in folders:
        if not folder.is_dir():
            raise ValueError(f"FOLDER must be a folder with {RIG} and records in it or below it; got {folder}")
        here = {path.parent for path in folder.resolve().rglob(RIG)}
        if not here:
            raise ValueError(f"{folder}: folder must have a {RIG} in it or below it; got none")
        found |= here
    common = Path(os.path.commonpath([folder.parent for folder in found]))
    digest = hashlib.sha256(str(seed).encode())
    for path in effects:
        digest.update(path.read_bytes())
    own = tuple(path.resolve() for path in effects)
    names = {folder: _name(folder.relative_to(common)) for folder in sorted(found)}
    often, series = Counter(names.values()), list[Series]()
    for folder, name in names.items():
        records, of_it = list(_records(folder)), digest.copy()
        of_it.update(os.fsencode(folder.relative_to(common)))
        for path in (folder / RIG, *records):
            of_it.update(os.fsencode(path.relative_to(folder)))
            for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
                with contextlib.suppress(OSError):  # the run says what cannot be read
                    of_it.update(file.read_bytes() if file.is_file() else b"")
        held = tuple(path for path in records if path.relative_to(folder).parts[0].startswith(HELD_OUT))
        train, number = tuple(path for path in records if path not in held), of_it.hexdigest()[:16]
        own_name = f"{name} {number[:8]}" if often[name] > 1 else name
        series.append(Series(number, own_name, folder, train, held, out.resolve() / own_name, own, seed))
    return series


def _name(path: Path) -> str:
    """Its parts with codes for what is no text, an end of a line or a control character; long ones are cut."""
    parts = [printable(text_of(part)).replace("\n", "\\n").replace("\t", "\\t") for part in path.parts]
    return "/".join(part if len(part.encode()) <= _LONGEST else part[: _LONGEST // 4] for part in parts)


def _records(folder: Path) -> Iterator[Path]:
    """Files that can be read as records, in the folder and in a folder of those held out."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.name in HELD_OUT and path.is_dir() and format_of(path) is None:
            yield from _records(path)
        elif path.name.lower().endswith(ENDINGS) or format_of(path) or (path.is_file() and is_log(path)):
            yield path
