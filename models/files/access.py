"""Files that a user names, opened and read in one way: regular ones alone, within a bound; drafts, private folders."""

import atexit
import codecs
import json
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, Final
from uuid import uuid4

LARGEST_TEXT: Final = 1 << 20  # bytes of a file that a person writes
LARGEST_DATA: Final = 1 << 31  # bytes of a file of samples
WINDOWS: Final = "cp1252"
_MARKS: Final = (
    (b"\xff\xfe\x00\x00", "UTF-32"),
    (b"\x00\x00\xfe\xff", "UTF-32"),
    (b"\xff\xfe", "UTF-16"),
    (b"\xfe\xff", "UTF-16"),
)


def opened(path: Path, what: str, largest: int = LARGEST_DATA) -> BinaryIO:
    """The file `path` for reading bytes. Raises ValueError, which names the kind of file by `what`, unless it is a
    regular one of at most `largest` bytes; a pipe or a device is refused without waiting for it.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:  # a name with a zero byte is a plain ValueError
        got = getattr(error, "strerror", None) or error
        raise ValueError(f"{path}: {what} must be a file that can be read; got: {got}") from None
    found = os.fstat(handle)
    if stat.S_ISREG(found.st_mode) and found.st_size <= largest:
        return os.fdopen(handle, "rb")
    os.close(handle)
    if stat.S_ISREG(found.st_mode):
        raise ValueError(f"{path}: {what} must be smaller than {largest} bytes; got {found.st_size}")
    got = "a directory" if stat.S_ISDIR(found.st_mode) else "a device, a pipe or a socket"
    raise ValueError(f"{path}: {what} must be a regular file; got {got}")


def check_source(path: Path, what: str) -> int:
    """The size in bytes of a file that a library will open by its name. Errors as `opened`."""
    with opened(path, what) as file:
        return os.fstat(file.fileno()).st_size


def read_bytes(path: Path, what: str, largest: int = LARGEST_TEXT) -> bytes:
    """The content of a file of at most `largest` bytes. Errors as `opened`."""
    with opened(path, what, largest) as file:
        try:
            data = file.read(largest + 1)
        except OSError as error:
            got = error.strerror or error
            raise ValueError(f"{path}: {what} must be a file that can be read; got: {got}") from None
    if len(data) > largest:
        raise ValueError(f"{path}: {what} must be smaller than {largest} bytes; got {len(data)} or more")
    return data


def read_text(path: Path, what: str, largest: int = LARGEST_TEXT) -> str:
    """The content of a file of UTF-8 text, with or without a byte-order mark. Errors as `opened`."""
    data = read_bytes(path, what, largest)
    encoding = encoding_of(data)
    if encoding in dict(_MARKS).values():
        raise ValueError(f"{path}: {what} must be UTF-8 text; got {encoding}: save it as UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: {what} must be UTF-8 text; got another byte at {error.start}") from None


def encoding_of(start: bytes) -> str:
    """The codec of a text whose first bytes are `start`, of which the last character may be cut: by its byte-order
    mark, else UTF-8 where that fits, else Windows-1252, as a spreadsheet writes.
    """
    if marked := next((name for mark, name in _MARKS if start.startswith(mark)), None):
        return marked
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)
    except UnicodeDecodeError:
        return WINDOWS
    return "utf-8-sig"


def read_json(path: Path, what: str, largest: int = LARGEST_TEXT) -> dict[str, Any]:
    """The JSON object of a file. Raises ValueError for anything else. Errors as `opened`."""
    text = read_text(path, what, largest)
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:  # a number of more digits than Python reads is a plain ValueError
        raise ValueError(f"{path}: {what} must be JSON; got: {' '.join(str(error).split())[:200]}") from None
    if not isinstance(found, dict):
        raise ValueError(f"{path}: {what} must be a JSON object; got a {type(found).__name__}")
    return found


def text_of(name: str) -> str:
    """A file's name as text: its bytes that are no UTF-8 as codes, as `\\xfc`."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Within it, an OSError names `path`, as one of a write to an open file would not."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def draft(path: Path, data: bytes) -> Path:
    """A file beside `path` with `data`, to be moved there; leaves nothing where it raises OSError."""
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


def cache_folder() -> Path:
    """Where compiled code is kept: `CAPSULE_CACHE`, else the user's cache folder. Where that is not the user's alone or
    not writable, a folder of this process, which is announced once on standard error.
    """
    return _folder(
        os.environ.get("CAPSULE_CACHE")
        or os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "capsule")
    )


@cache
def _folder(root: str) -> Path:
    try:
        folder = private_folder(Path(root))
        if os.access(folder, os.W_OK):
            return folder
        why = "it cannot be written to"
    except OSError as error:
        why = error.strerror or str(error)
    print(f"compiled code is not kept in {root}: {why}", file=sys.stderr)
    folder = Path(tempfile.mkdtemp(prefix="capsule-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def private_folder(path: Path) -> Path:
    """Make the folder `path` for its owner alone. Raises OSError where others could have put something into it."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise PermissionError(0, "it must be a folder, not a link", str(path))
    if found.st_uid != os.geteuid():
        raise PermissionError(0, f"it must belong to user {os.geteuid()}; got {found.st_uid}", str(path))
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(0, "nobody else must be able to write to it: chmod go-w", str(path))
    return path
