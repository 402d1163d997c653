"""Files that are written complete or not at all: first under a temporary name, then renamed."""

import csv
import fcntl
import gzip
import io
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.app.system import shortage
from models.files.access import draft
from models.files.csv_text import guarded


def write_files(contents: Mapping[Path, str | bytes]) -> None:
    """Write several files; they take their names only once all of them are on disk."""
    waiting: list[tuple[Path, Path]] = []
    try:
        for path, content in contents.items():
            data = content.encode(errors="backslashreplace") if isinstance(content, str) else content
            waiting.append((draft(path, data), path))
        for temporary, path in waiting:
            temporary.replace(path)
    finally:
        for temporary, _ in waiting:
            temporary.unlink(missing_ok=True)


def file_trouble(error: OSError) -> str:
    """What the system refused, as a sentence: a file, or an exhausted resource."""
    if words := shortage(error):
        return words
    if error.filename is None:
        return f"the system must grant what the command needs; got: {error.strerror or error}"
    return f"{error.filename} must be one that can be read or written; got: {error.strerror or error}"


def table_text(columns: Mapping[str, NDArray[np.float64]]) -> str:
    """Columns of one length as CSV; no spreadsheet takes a name in its header for a formula."""
    text = io.StringIO()
    mistaken = any(mark in name for name in columns for mark in ";\t")
    writer = csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_ALL if mistaken else csv.QUOTE_MINIMAL)
    writer.writerow(guarded(name) for name in columns)
    np.savetxt(text, np.column_stack(list(columns.values())), delimiter=",", fmt="%.10g")
    return text.getvalue()


def write_table(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write columns of one length as CSV, gzipped where the name ends in `.gz`."""
    data = table_text(columns).encode()
    write_files({path: gzip.compress(data, mtime=0) if path.name.endswith(".gz") else data})


def check_folder(path: Path, option: str) -> Path:
    """Make the folder `path`; a ValueError of one sentence where it cannot be made or written to."""
    if path.exists() and not path.is_dir():
        raise ValueError(f"{option} must be a folder; got the file {path}")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{option} must be a folder that can be made; got {path}: {error.strerror}") from None
    try:
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise ValueError(
            f"{option} must be a folder that can be written to; got {path}: {error.strerror or error}"
        ) from None
    return path


@contextmanager
def sole_writer(path: Path, option: str) -> Iterator[None]:
    """Lock the folder for this process; it is removed again where it stays empty. Raises ValueError."""
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    check_folder(path, option)
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f"{option} must be a folder to which no other command writes; got {path}") from None
        yield
    finally:
        os.close(handle)
        with suppress(OSError):
            for folder in missing:
                folder.rmdir()


def own_folder(path: Path | None, option: str) -> AbstractContextManager[None]:
    return nullcontext() if path is None else sole_writer(path, option)


def check_file(path: Path, option: str, endings: tuple[str, ...]) -> Path:
    """Refuse a file name that cannot be written, before any work is done."""
    if not path.name.lower().endswith(endings):
        raise ValueError(f"{option} must be a file name that ends in {' or '.join(endings)}; got {path}")
    if path.exists() and not path.is_file():
        got = "folder" if path.is_dir() else "device, pipe or socket"
        raise ValueError(f"{option} must be a file; got the {got} {path}")
    check_folder(path.absolute().parent, f"folder of {option}")
    return path


def check_targets(outputs: Sequence[Path], option: str, inputs: Sequence[Path]) -> None:
    """Refuse outputs that are folders, or files that are also inputs, before any work is done."""
    for out in outputs:
        if out.is_dir():
            raise ValueError(f"{option} must leave the name {out.name} free for a file; got the folder {out}")
        if out.exists() and any(path.exists() and out.samefile(path) for path in inputs):
            raise ValueError(f"{option} must not be a file that is read, which would be overwritten; got {out}")


def check_mcap(path: Path, inputs: Sequence[Path]) -> None:
    """Refuse an `--mcap` that cannot be written, also because its library is missing."""
    check_targets([check_file(path, "--mcap", (".mcap",))], "--mcap", inputs)
    if find_spec("mcap") is None:
        raise ValueError("--mcap needs the package mcap, which is not installed: pip install '.[mcap]'")
