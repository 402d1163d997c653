"""One BLF file of frames that is readable at every moment: whole containers, and a header that is right after each of
them.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Final, NamedTuple

import can

RECEIVED, SENT, WITHHELD, NOTED = 1, 2, 3, 4
"""Which way a frame went: to the node that logs, from it, from it but kept back (a dry run); or it is no frame but a
note.
"""
LATEST_S: Final = 1e6
PACKED: Final = struct.Struct("<qIBB8s2x")
"""A frame between processes: time in ns, identifier, way, length, data."""


class Logged(NamedTuple):
    """One frame as the node that logs saw it: `time_ns` on that node's clock, of arrival or of the tick that sent
    it.
    """

    time_ns: int
    id: int
    data: bytes
    way: int

    @property
    def time_s(self) -> float:
        """Time in s."""
        return self.time_ns / 1e9

    def packed(self) -> bytes:
        """The frame as `PACKED`."""
        return PACKED.pack(self.time_ns, self.id, self.way, len(self.data), self.data)


def unpacked(block: bytes) -> list[Logged]:
    """The frames of a block of whole `PACKED` records."""
    return [Logged(ns, number, data[:length], way) for ns, number, way, length, data in PACKED.iter_unpack(block)]


class BlfFile(can.BLFWriter):
    """A BLF file whose times are those of the node's clock, not of the calendar (the record beside the file knows when
    it began).

    Withheld frames stand on channel 2, notes on channel 3. `flush` ends a container and hands everything to the
    operating system: what was written before survives the death of the process (not of the machine).
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, compression_level=1)
        self.start_timestamp = 0.0
        self.flush()

    def write(self, frame: Logged) -> None:
        """Add a frame."""
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
        """Bring the file up to date."""
        self._flush()
        self.file.flush()
        end = self.file.tell()
        self.file.seek(0)
        self._write_header(end)
        self.file.flush()
        self.file.seek(end)


def way_of(message: can.Message) -> int:
    """Which way a frame of a BLF file went."""
    if message.is_rx:
        return RECEIVED
    return WITHHELD if message.channel == 1 else NOTED if message.channel == 2 else SENT
