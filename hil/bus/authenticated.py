"""Authenticated frames after AUTOSAR's Secure Onboard Communication: neither forged nor replayed. And their key."""

import contextlib
import fcntl
import hmac
import os
import stat
import struct
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Final

import can

from hil.bus.wrapping import WrappingBus, fd_frame, plain

PAYLOAD: Final = 8  # bytes of the catalogue's frame, which come first
LENGTH: Final = 24  # bytes of a frame on the wire: payload, freshness (count, then epoch), authenticator
_FRESHNESS: Final = struct.Struct("<II")
_IDENTIFIER: Final = struct.Struct("<H")
_CODE: Final = 8  # bytes of a frame's authenticator
_COUNTS: Final = 1 << 32  # of 32 bits, after which a key must change
_SENDERS: Final = 8  # starts of a sender that are remembered
_MOST: Final = 64  # frames that are refused in one call


def authenticator(key: bytes) -> Callable[[int, bytes], bytes]:
    """The function of a frame's authenticator: the first 8 bytes of AES-CMAC (RFC 4493) with `key` over identifier (2
    bytes, little endian), payload and freshness. Raises ValueError without the package cryptography.
    """
    try:
        from cryptography.hazmat.primitives.ciphers.algorithms import AES
        from cryptography.hazmat.primitives.cmac import CMAC
    except ImportError:
        hint = "pip install 'capsule-control[secure]'"
        raise ValueError(f"bus.key_file must go with the package cryptography; it is missing: {hint}") from None
    begun = CMAC(AES(key))

    def code(identifier: int, body: bytes) -> bytes:
        made = begun.copy()
        made.update(_IDENTIFIER.pack(identifier) + body)
        return made.finalize()[:_CODE]

    return code


def sealed(
    code: Callable[[int, bytes], bytes], identifier: int, payload: bytes | bytearray, count: int, epoch: int
) -> bytes:
    """The 24 bytes on the wire of a frame with `payload`, `code` being the function of `authenticator`."""
    body = bytes(payload) + _FRESHNESS.pack(count, epoch)
    return body + code(identifier, body)


def freshness(data: bytes | bytearray) -> tuple[int, int]:
    count, epoch = _FRESHNESS.unpack(data[PAYLOAD:-_CODE])
    return count, epoch


def inside(wire: can.Message) -> can.Message:
    """The classic frame inside a frame of the wire, without a check."""
    number, data = wire.arbitration_id, wire.data[:PAYLOAD]
    return can.Message(wire.timestamp, number, False, data=data, is_rx=wire.is_rx, channel=wire.channel)


class AuthenticatedBus(WrappingBus):
    """Sends and receives the catalogue's classic frames as CAN FD frames of 24 bytes on `inner`, with freshness and
    authenticator (docs/bus.md).

    For each identifier a frame is accepted if its epoch is greater than all before, or known with a greater count; the
    node's own frames count too. `refused` counts the others, at most 64 in one `recv`: `classic` (not FD), `type`,
    `length`, `forged`, `replayed`. Error frames are passed on.
    """

    def __init__(self, inner: can.BusABC, key: bytes, epoch: int) -> None:
        """Raises ValueError without the package cryptography."""
        self._code = authenticator(key)
        super().__init__(inner, inner.channel_info)
        self.refused: Counter[str] = Counter()
        self._epoch, self._count = epoch, 0
        self._seen: dict[int, dict[int, int]] = {}

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame of the catalogue. Raises ValueError for any other frame, and after 2^32 frames."""
        if not plain(msg) or len(msg.data) != PAYLOAD:
            raise ValueError(f"message must be a classic data frame of {PAYLOAD} bytes with an 11-bit id; got {msg}")
        if self._count + 1 >= _COUNTS:
            raise ValueError("count of authenticated frames must stay below 2^32; restart the node")
        self._count += 1
        self._seen.setdefault(msg.arbitration_id, {})[self._epoch] = self._count
        data = sealed(self._code, msg.arbitration_id, msg.data, self._count, self._epoch)
        self.inner.send(fd_frame(msg.arbitration_id, data), timeout)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next genuine and fresh frame, as a classic one; raises as the inner bus."""
        end = None if timeout is None else time.monotonic() + timeout
        for _ in range(_MOST):
            message = self.inner.recv(None if end is None else max(end - time.monotonic(), 0.0))
            if message is None:
                return None
            found = self._opened(message)
            if isinstance(found, can.Message):
                return found
            self.refused[found] += 1
        return None

    def _opened(self, wire: can.Message) -> can.Message | str:
        if wire.is_error_frame:
            return wire
        if wire.is_extended_id or wire.is_remote_frame:
            return "type"
        if not wire.is_fd:
            return "classic"
        data = bytes(wire.data)
        if len(data) != LENGTH:
            return "length"
        identifier, body = wire.arbitration_id, data[:-_CODE]
        if not hmac.compare_digest(self._code(identifier, body), data[-_CODE:]):
            return "forged"
        return inside(wire) if self._fresh(identifier, *freshness(data)) else "replayed"

    def _fresh(self, identifier: int, count: int, epoch: int) -> bool:
        seen = self._seen.setdefault(identifier, {})
        if epoch in seen:
            if count <= seen[epoch]:
                return False
        elif seen and epoch < max(seen):
            return False
        elif len(seen) == _SENDERS:
            del seen[min(seen)]
        seen[epoch] = count
        return True


_SIZES: Final = (16, 32)  # bytes of an AES key that are taken
_LONGEST: Final = 4096  # bytes of its file
_EPOCHS: Final = 1 << 32  # of 32 bits


def read_key(path: Path) -> bytes:
    """The AES key in `path`, hexadecimal. Raises ValueError for a file that others can read."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise ValueError(f"bus.key_file must be a file that can be read; got {path}: {error.strerror}") from None
    try:
        file = os.fstat(descriptor)
        mode = stat.S_IMODE(file.st_mode)
        if not stat.S_ISREG(file.st_mode) or file.st_uid != os.getuid():
            raise ValueError(f"bus.key_file must be a regular file that belongs to this user; got {path}")
        if mode & 0o177:
            raise ValueError(f"bus.key_file must be its owner's alone ('chmod 600 {path}'); got mode {mode:04o}")
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
    """A 32-bit number greater than at all earlier starts with the key file `path`: the calendar's seconds, or one more
    than the last one, which is kept beside the key in `NAME.epoch`. Raises ValueError if that cannot be written.
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
        raise ValueError(f"{kept} must hold the last start's number, below {_EPOCHS}; got another content") from None
    return epoch
