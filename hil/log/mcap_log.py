"""The good frames of a log as MCAP, live: one topic per frame, as `capsule convert` writes them."""

from pathlib import Path
from typing import Final

from hil.bus.catalogue import load_catalogue
from hil.bus.codec import Refusal, without_absent
from hil.bus.protection import Reception
from hil.formats.mcap_file import McapTopics
from hil.log.blf_file import RECEIVED, SENT, Logged
from models.files.access import writing

_CHUNK: Final = 1 << 16  # bytes of a chunk, which is written once it is full: half a second at 500 Hz


class McapLog:
    """An MCAP file of the node's frames, with times of its clock. A topic begins with its first frame."""

    def __init__(self, path: Path) -> None:
        """Begin the file. Raises OSError if it cannot be written, RefusedError without the library."""
        catalogue = load_catalogue()
        self._frames = catalogue.by_id()
        self._reception = Reception(self._frames.values())
        self._begun: set[int] = set()
        self._path = path
        self._file = path.open("wb")
        self._topics = McapTopics(self._file, _CHUNK)

    def write(self, frame: Logged) -> None:
        """Add a frame; notes, withheld frames and those that the protection refuses are skipped. Raises OSError."""
        if frame.direction not in (RECEIVED, SENT):
            return
        values = self._reception.accept(frame.id, frame.data, frame.time_s)
        if isinstance(values, Refusal):
            return
        known = self._frames[frame.id]
        with writing(self._path):
            if frame.id not in self._begun:
                self._begun.add(frame.id)
                self._topics.add(known.name, {field.name: field.unit for field in known.fields})
            self._topics.write(known.name, frame.time_ns, without_absent(known.name, values))

    def flush(self) -> None:
        """Write the whole chunks."""
        with writing(self._path):
            self._file.flush()

    def close(self) -> None:
        with writing(self._path):
            self._topics.finish()
            self._file.close()
