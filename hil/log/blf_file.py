"""A BLF file that is readable at every moment: whole containers and a valid header."""

import struct
from pathlib import Path
from typing import Final, NamedTuple

import can

from models.files.access import writing

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


def _whole(head: bytes) -> int:
    """The size in bytes that the file's header states."""
    return int(_HEAD.unpack(head)[10])


def direction_of(message: can.Message) -> int:
    if message.is_rx:
        return RECEIVED
    return WITHHELD if message.channel == 1 else NOTED if message.channel == 2 else SENT
