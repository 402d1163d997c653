"""BLF files: ours, readable at every moment, and any, read with every size checked."""

import struct
import zlib
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

import can
from can.io.blf import systemtime_to_timestamp

from models.files.access import opened, writing

RECEIVED, SENT, WITHHELD, NOTED = 1, 2, 3, 4
"""Direction of an entry: a frame to the node, from it, not sent in a dry run; or a note instead of a frame."""
LOST: Final = 8  # the note that frames are missing (other notes: `hil.log.recorder`)
LATEST_S: Final = 1e6  # latest time in a log
APPLICATION: Final = 200  # application in the BLF header of our own files
_HEAD: Final = struct.Struct("<4sLBBBBBBBBQ")
PACKED: Final = struct.Struct(
    "<qIBB8s2x"
)  # An entry between processes: time in ns, identifier, direction, length, data


class Logged(NamedTuple):
    """One entry of a log: its `direction`, and `time_ns` of arrival or of the sending tick on the node's clock."""

    time_ns: int
    id: int
    data: bytes
    direction: int

    @property
    def time_s(self) -> float:
        return self.time_ns / 1e9

    def packed(self) -> bytes:
        return PACKED.pack(self.time_ns, self.id, self.direction, len(self.data), self.data)


def unpacked(block: bytes) -> list[Logged]:
    """The frames of a block of whole `PACKED` records."""
    return [
        Logged(ns, number, data[:length], direction)
        for ns, number, direction, length, data in PACKED.iter_unpack(block)
    ]


class BlfFile(can.BLFWriter):
    """A BLF file with times of the node's clock, whose zero is `calendar_s` (s since 1970). Withheld frames are on
    channel 2, notes on channel 3. Entries before a `flush` survive the death of the process. With `append` the file of
    a dead writer is continued after its last whole container.
    """

    application_id = APPLICATION

    def __init__(self, path: Path, calendar_s: float = 0.0, *, append: bool = False) -> None:
        self._calendar_s, self._path = calendar_s, path
        if append:
            with path.open("rb+") as file:
                file.truncate(int(_HEAD.unpack(file.read(_HEAD.size))[10]))  # what the header states
        super().__init__(path, append=append, compression_level=1)
        self.start_timestamp = 0.0
        self.flush()

    def _write_header(self, filesize: int) -> None:
        begin, end = self.start_timestamp, self.stop_timestamp
        self.start_timestamp = self._calendar_s
        self.stop_timestamp = self._calendar_s + (end or 0.0)
        super()._write_header(filesize)
        self.start_timestamp, self.stop_timestamp = begin, end

    def write(self, frame: Logged) -> None:
        """Add an entry. A container is ended before it is full, so that no entry is split."""
        if self._buffer_size > self.max_container_size - 256:
            self.flush()
        self.on_message_received(
            can.Message(
                (frame.time_ns + 0.5) * 1e-9,
                frame.id,
                False,
                data=frame.data,
                is_rx=frame.direction == RECEIVED,
                channel=max(frame.direction - SENT, 0),
            )
        )

    def flush(self) -> None:
        """Write all entries to the file. Raises OSError."""
        with writing(self._path):
            self._flush()
            self.file.flush()
            end = self.file.tell()
            self.file.seek(0)
            self._write_header(end)
            self.file.flush()
            self.file.seek(end)

    def stop(self) -> None:
        """End the file. Raises OSError."""
        with writing(self._path):
            super().stop()


def is_own(head: bytes) -> bool:
    """Whether `head` begins a BLF file of ours, with times of a node's clock."""
    return len(head) >= _HEAD.size and _HEAD.unpack_from(head)[2] == APPLICATION


def direction_of(message: can.Message) -> int:
    if message.is_rx:
        return RECEIVED
    return WITHHELD if message.channel == 1 else NOTED if message.channel == 2 else SENT


LARGEST_CONTAINER: Final = 1 << 26  # bytes, packed and unpacked; Vector's and python-can's have 128 kB
MOST_BYTES: Final = 1 << 32  # of all containers together, unpacked
_FILE: Final = struct.Struct("<4sLBBBBBBBBQQLL8H8H")
_BASE: Final = struct.Struct("<4sHHLL")
_STAMP: Final = struct.Struct("<L2HQ")
_CONTAINER: Final = struct.Struct("<H6xL4x")
_FRAME: Final = struct.Struct("<HBBL8s")
_CONTAINERS, _FRAMES = 10, (1, 86)  # types of objects in a BLF file
_HEADERS: Final = {1: 32, 2: 40}  # bytes of an object's header of each version that there is
_LARGEST_ID, _REMOTE, _DIRECTION, _TEN_US = 0x7FF, 0x80, 0x1, 1  # of a base frame; flags of an object
_BY_CHANNEL: Final = {2: WITHHELD, 3: NOTED}

Tell = Callable[[str], None]


def read_blf(path: Path, tell: Tell) -> Iterator[Logged]:
    """The frames of `path`; for a file that is cut off `tell` gets a sentence. Raises ValueError with the byte."""
    with opened(path, "log") as file:
        yield from _BlfReading(path, file).frames(tell)


def whole(path: Path) -> bool:
    """Whether the file consists of whole objects up to the size that its header states."""
    try:
        with path.open("rb") as file:
            reading = _BlfReading(path, file)
            for _ in reading.containers():
                pass
            return reading.offset >= reading.size == reading.stated
    except (OSError, ValueError):
        return False


class _BlfReading:
    """The reading of one file; `offset` is the offset of the current object."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self.path, self.file = path, file
        self.offset = self.count = self.unpacked = 0
        data = file.read(_FILE.size)
        if len(data) < _FILE.size or data[:4] != b"LOGG":
            raise ValueError(f"{path}: log must be one in the format that its name ends in; got another content")
        head = _FILE.unpack(data)
        self.size = file.seek(0, 2)
        self.stated = int(head[10])
        try:
            self.start_ns = 0 if is_own(data) else round(systemtime_to_timestamp(head[14:22]) * 1e9)
        except (ValueError, OverflowError):
            self.start_ns = 0
        self.offset = max(int(head[1]), _FILE.size)

    def frames(self, tell: Tell) -> Iterator[Logged]:
        rest = b""
        for size in self.containers():
            rest = yield from self._objects(rest + self._content(size))
        if self.offset < self.size or rest.strip(b"\0") or self.stated > self.size:
            tell(f"the log is cut off at byte {self.size}; the {self.count} frames before it are read")

    def containers(self) -> Iterator[int]:
        """The size of each container's content, up to a container that is cut off; the file is at its begin."""
        while self.offset < self.size:
            self.file.seek(self.offset)
            head = self.file.read(_BASE.size)
            if len(head) < _BASE.size:
                return
            mark, _, _, size, kind = _BASE.unpack(head)
            if mark != b"LOBJ":
                raise self._wrong("an object", "another content")
            if size < _BASE.size:
                raise self._wrong(f"an object of {_BASE.size} bytes or more", f"one of {size}")
            if self.offset + size > self.size:
                return
            if kind == _CONTAINERS:
                yield size - _BASE.size
            self.offset += size + size % 4

    def _content(self, size: int) -> bytes:
        if size < _CONTAINER.size or size > LARGEST_CONTAINER:
            raise self._wrong(f"a container of {_CONTAINER.size} to {LARGEST_CONTAINER} bytes", f"one of {size}")
        data = self.file.read(size)
        method, _ = _CONTAINER.unpack_from(data)
        packed = data[_CONTAINER.size :]
        if method not in (0, 2):
            raise self._wrong("a container that is packed with zlib, or not at all", f"method {method}")
        try:
            content = zlib.decompressobj().decompress(packed, LARGEST_CONTAINER + 1) if method else packed
        except zlib.error as error:
            where = f"after {self.count} frames, at byte {self.offset}"
            raise ValueError(f"{self.path}: log must be undamaged; got {where}: {error}") from None
        self.unpacked += len(content)
        if len(content) > LARGEST_CONTAINER or self.unpacked > MOST_BYTES:
            raise self._wrong(f"at most {LARGEST_CONTAINER} bytes, unpacked, {MOST_BYTES} in all", "more")
        return content

    def _objects(self, data: bytes) -> Generator[Logged, None, bytes]:
        """The frames among unpacked objects; returns the begin of an object that continues in the next container."""
        at = 0
        while True:
            found = data.find(b"LOBJ", at, at + 8)
            if found < 0 and at + 8 > len(data):
                return data[at:]
            if found < 0:
                raise self._wrong("an object", "another content", at)
            at = found
            if len(data) - at < _BASE.size:
                return data[at:]
            _, _, version, size, kind = _BASE.unpack_from(data, at)
            if version not in _HEADERS:
                raise self._wrong("an object with a header of version 1 or 2", f"version {version}", at)
            header = _HEADERS[version]
            if not header <= size <= LARGEST_CONTAINER:
                raise self._wrong(f"an object of {header} to {LARGEST_CONTAINER} bytes", f"one of {size}", at)
            if at + size > len(data):
                return data[at:]
            if kind in _FRAMES and size >= header + _FRAME.size:
                yield from self._frame(data, at, header)
            at += size

    def _frame(self, data: bytes, at: int, header: int) -> Iterator[Logged]:
        unit, _, _, stamp = _STAMP.unpack_from(data, at + _BASE.size)
        channel, flags, length, number, content = _FRAME.unpack_from(data, at + header)
        self.count += 1
        if number > _LARGEST_ID or flags & _REMOTE:
            return
        direction = _BY_CHANNEL.get(channel, SENT) if flags & _DIRECTION else RECEIVED
        time_ns = self.start_ns + stamp * (10_000 if unit == _TEN_US else 1)
        yield Logged(time_ns, number, content[: min(length, 8)], direction)

    def _wrong(self, wanted: str, got: str, within: int | None = None) -> ValueError:
        offset = f"at byte {self.offset}" + ("" if within is None else f", byte {within} of what it unpacks to")
        return ValueError(f"{self.path}: log must have {wanted} {offset}; got {got}")
