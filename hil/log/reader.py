"""Reads CAN logs of all formats of python-can, and the record beside a log of ours.

An MF4 file, which needs asammdf, is read in a separate process, so that a damaged file does no harm.
"""

import warnings
from collections.abc import Iterator
from importlib import reload
from pathlib import Path
from typing import IO, Any, Final

import can
import can.io.mf4

from hil.formats.channels import library, refusing
from hil.formats.mf4_file import EXTRA, check_within
from hil.formats.reading import confined, is_log, reading_process
from hil.log.blf_file import PACKED, Logged, direction_of
from hil.log.blf_reader import Tell, read_blf
from hil.log.place import record_path
from hil.log.text_log import text_reader
from models.files.access import check_source, read_json

_END: Final = 0xFFFF_FFFF
"""Identifier of the entry after the last frame: its time is the length of the sentence that follows."""
LARGEST_RECORD: Final = 1 << 26  # bytes


def read_frames(path: Path, tell: Tell | None = None) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of the log `path`, in its order. A log of ours has the times of
    its node's clock. Of a BLF file that is cut off the whole frames are read, and `tell` gets a sentence. Raises
    ValueError.
    """
    if check_source(path, "log") == 0:
        raise ValueError(f"{path}: log must hold frames; got an empty file")
    if path.suffix.lower() == ".blf":
        yield from read_blf(path, tell or (lambda _: None))
        return
    if path.suffix.lower() == ".mf4":
        if not is_log(path):
            raise ValueError(f"{path}: log must hold frames of a CAN bus; got an MF4 file without any")
        yield from read_mf4_frames(path)
        return
    yield from library_frames(path, tell)


def read_log_record(path: Path) -> dict[str, Any]:
    """The record beside the log `path`. Raises ValueError of one sentence without one."""
    beside = record_path(path)
    if not beside.exists():
        raise ValueError(f"{beside}: record of the log must be there; got no such file")
    return read_json(beside, "record of the log", LARGEST_RECORD)


def library_frames(path: Path, tell: Tell | None = None) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of a file that python-can reads. Raises ValueError."""
    reader: Any
    late = 0.0
    try:
        if path.suffix.lower() in (".log", ".asc"):
            reader, late = text_reader(path, tell or (lambda _: None))
        else:
            reader = can.LogReader(path)
    except Exception as error:  # noqa: BLE001 - libraries raise whatever they like at a damaged file
        raise ValueError(f"{path}: log must be one in the format that its name ends in; got: {_words(error)}") from None
    with reader:
        yield from _frames(reader, path, round(late * 1e9))


def _frames(reader: Any, path: Path, late_ns: int) -> Iterator[Logged]:
    messages, count = iter(reader), 0
    while True:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                message = next(messages)
            stamp = round(message.timestamp * 1e9) - late_ns
        except StopIteration:
            return
        except Exception as error:
            if str(error).startswith(f"{path}: "):
                raise
            raise ValueError(f"{path}: log must be whole; got after {count} frames: {_words(error)}") from None
        count += 1
        if not (message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd):
            yield Logged(stamp, message.arbitration_id, bytes(message.data), direction_of(message))


def _words(error: BaseException) -> str:
    return " ".join(str(error).split())[:160] or type(error).__name__


def read_mf4_frames(path: Path) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of the MF4 file `path`. Raises ValueError of one sentence."""
    with reading_process("hil.log.reader", path) as reader:
        assert reader.stdout is not None
        yield from _received(path, reader.stdout)


def _received(path: Path, source: IO[bytes]) -> Iterator[Logged]:
    while len(data := source.read(PACKED.size)) == PACKED.size:
        time_ns, identifier, direction, size, content = PACKED.unpack(data)
        if identifier != _END:
            yield Logged(time_ns, identifier, content[:size], direction)
        elif wrong := source.read(time_ns).decode():
            raise ValueError(f"{path}: {wrong}")
        else:
            return
    raise ValueError(f"{path}: log must be a whole MF4 file; got one at which the reader ended")


def send_frames(path: Path, target: IO[bytes]) -> None:
    """Write the frames of `path` to `target`, and then a sentence if something is wrong."""
    wrong = b""
    try:
        with refusing(path, "a log"):
            library("asammdf", EXTRA)
            reload(can.io.mf4)  # it was loaded without (`hil`)
            check_within(path)
        for frame in library_frames(path):
            target.write(frame.packed())
    except ValueError as error:
        wrong = str(error).removeprefix(f"{path}: ").encode()
    target.write(PACKED.pack(len(wrong), _END, 0, 0, b"") + wrong)
    target.flush()


if __name__ == "__main__":
    confined(send_frames)
