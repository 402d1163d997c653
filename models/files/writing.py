"""Drafts of files that take their name once they are whole, and errors of writing that name the file."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """What is written to `path` in here: an OSError names it, which one of a write to an open file does not."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def draft(path: Path, data: bytes) -> Path:
    """A file beside `path` with `data`, to be moved to `path`; who may read it is as the user's umask has it. Raises
    OSError, and leaves nothing then.
    """
    made = path.with_name(f".{path.name}.{uuid4().hex[:12]}")
    with writing(path):
        handle = os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
        except BaseException:
            made.unlink(missing_ok=True)
            raise
    return made
