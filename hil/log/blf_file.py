"""One BLF file of frames that is readable at every moment: whole containers, and a header that is right."""

import struct
from pathlib import Path
from typing import Final, NamedTuple

import can

from models.files.access import writing

RECEIVED, SENT, WITHHELD, NOTED = 1, 2, 3, 4
"""Which way a frame went: to the node, from it, kept back (a dry run); or it is no frame but a note."""
LOST: Final = 8  # the note that frames are missing (the other notes: `hil.log.recorder`)
LATEST_S: Final = 1e6  # of a log's own time
APPLICATION: Final = 200  # the application that writes, in a BLF header: by it our own files are known
_HEAD: Final = struct.Struct("<4sLBBBBBBBBQ")
PACKED: Final = struct.Struct("<qIBB8s2x")  # A frame between processes: time in ns, identifier, way, length, data


class Logged(NamedTuple):
    """One frame as the node that logs saw it: `time_ns` on its clock, of arrival or of the tick that sent it."""

    time_ns: int
    id: int
    data: bytes
    way: int

    @property
    def time_s(self) -> float:
        return self.time_ns / 1e9

    def packed(self) -> bytes:
        return PACKED.pack(self.time_ns, self.id, self.way, len(self.data), self.data)


def unpacked(block: bytes) -> list[Logged]:
    """The frames of a block of whole `PACKED` records."""
    return [Logged(ns, number, data[:length], way) for ns, number, way, length, data in PACKED.iter_unpack(block)]


class BlfFile(can.BLFWriter):
    """A BLF file whose times are those of the node's clock, which showed 0 at `calendar_s` (s since 1970). Withheld
    frames stand on channel 2, notes on channel 3. What was written before `flush` survives the death of the process.
    With `append` a file whose writer has died goes on after its last whole container.
    """

    application_id = APPLICATION

    def __init__(self, path: Path, calendar_s: float = 0.0, *, append: bool = False) -> None:
        self._calendar_s, self._path = calendar_s, path
        if append:
            with path.open("rb+") as file:
                file.truncate(_whole(file.read(_HEAD.size)))
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
        """Add a frame. A container is ended before it is full, so that none ends within a frame."""
        if self._buffer_size > self.max_container_size - 256:
            self.flush()
        self.on_message_received(
            can.Message(
                (frame.time_ns + 0.5) * 1e-9,
                frame.id,
                False,
                data=frame.data,
                is_rx=frame.way == RECEIVED,
                channel=max(frame.way - SENT, 0),
            )
        )

    def flush(self) -> None:
        """Bring the file up to date. Raises OSError."""
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
    """Whether a BLF file that begins with `head` is one of ours, with times of a node's clock."""
    return len(head) >= _HEAD.size and _HEAD.unpack_from(head)[2] == APPLICATION


def _whole(head: bytes) -> int:
    """The size in bytes that a file's header knows of."""
    return int(_HEAD.unpack(head)[10])


def way_of(message: can.Message) -> int:
    if message.is_rx:
        return RECEIVED
    return WITHHELD if message.channel == 1 else NOTED if message.channel == 2 else SENT
