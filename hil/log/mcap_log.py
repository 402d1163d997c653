"""The good frames of a log as MCAP while it is written: a topic a frame, as `capsule convert` has them."""

from pathlib import Path
from typing import Final

from hil.bus.catalogue import load_catalogue
from hil.bus.codec import Refusal, without_absent
from hil.bus.protection import Reception
from hil.formats.mcap_file import McapTopics
from hil.log.blf_file import RECEIVED, SENT, Logged
from models.files.access import writing

_CHUNK: Final = 1 << 16  # bytes of a chunk, which is on file once it is full: half a second at 500 Hz


class McapLog:
    """An MCAP file of the node's frames, times on its clock. A topic begins with the first frame of its name."""

    def __init__(self, path: Path) -> None:
        """Begin the file. Raises OSError where it cannot be written, RefusedError without the library."""
        catalogue = load_catalogue()
        self._frames = catalogue.by_id()
        self._reception = Reception(self._frames.values())
        self._begun: set[int] = set()
        self._path = path
        self._file = path.open("wb")
        self._topics = McapTopics(self._file, _CHUNK)

    def write(self, frame: Logged) -> None:
        """Add a frame; notes, what a dry run withheld and what protection refuses are left out. Raises OSError."""
        if frame.way not in (RECEIVED, SENT):
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
        """Hand what is in whole chunks to the operating system."""
        with writing(self._path):
            self._file.flush()

    def close(self) -> None:
        with writing(self._path):
            self._topics.finish()
            self._file.close()
