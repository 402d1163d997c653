"""The key of an authenticated bus, from a file that is its owner's alone, and the number of each start with it."""

import contextlib
import fcntl
import os
import stat
import time
from pathlib import Path
from typing import Final

_SIZES: Final = (16, 32)  # bytes of an AES key that are taken
_LONGEST: Final = 4096  # bytes of its file
_EPOCHS: Final = 1 << 32  # of 32 bits


def read_key(path: Path) -> bytes:
    """The AES key in `path`, hexadecimal. Raises ValueError for a file that is not this user's alone."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise ValueError(f"bus.key_file must be a file that can be read; got {path}: {error.strerror}") from None
    try:
        told = os.fstat(descriptor)
        if not stat.S_ISREG(told.st_mode) or told.st_uid != os.getuid():
            raise ValueError(f"bus.key_file must be a regular file that belongs to this user; got {path}")
        if stat.S_IMODE(told.st_mode) & 0o177:
            raise ValueError(
                f"bus.key_file must be its owner's alone ('chmod 600 {path}'); got mode"
                f" {stat.S_IMODE(told.st_mode):04o}"
            )
        text = os.read(descriptor, _LONGEST + 1)
    finally:
        os.close(descriptor)
    try:
        key = bytes.fromhex(text.decode("ascii").strip())
    except ValueError:
        key = b""
    if len(key) not in _SIZES:
        raise ValueError(f"bus.key_file must hold 32 or 64 hexadecimal digits ('openssl rand -hex 16'); got {path}")
    return key


def next_epoch(path: Path) -> int:
    """A number of 32 bits greater than that of any start with the key file `path`: the calendar's seconds, or one more
    than the last one, kept beside the key in `NAME.epoch`. Raises ValueError where that cannot be kept.
    """
    kept = path.with_name(f"{path.name}.epoch")
    try:
        descriptor = os.open(kept, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        with os.fdopen(descriptor, "r+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            text = file.read(_LONGEST).strip()
            last = int(text) if text else 0
            epoch = max(int(time.time()), last + 1)
            if not 0 <= last < epoch < _EPOCHS:
                raise ValueError
            file.seek(0)
            file.write(b"%d\n" % epoch)
            file.truncate()
            file.flush()
            with contextlib.suppress(OSError):
                os.fsync(descriptor)
    except OSError as error:
        raise ValueError(f"bus.key_file must lie where {kept} can be written; got: {error.strerror}") from None
    except ValueError:
        raise ValueError(
            f"{kept} must hold the number of the last start, below {_EPOCHS}; got another content"
        ) from None
    return epoch
