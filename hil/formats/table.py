"""The formats of other programs' files that can be read and written, in one table."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hil.formats import matlab_file, mcap_file, mf4_file, parquet_file, ros_bag, tdms_file
from hil.formats.channels import Channel, Read, refusing
from models.files.access import opened

Write = Callable[[Path, Sequence[Channel]], None]


@dataclass(frozen=True)
class Format:
    """A kind of file: its endings, the extra that brings its library, and what reads and writes it."""

    name: str
    endings: tuple[str, ...]
    extra: str
    read: Read
    write: Write | None = None


FORMATS: Final = (
    Format("Parquet", (".parquet",), parquet_file.EXTRA, parquet_file.read, parquet_file.write),
    Format("MF4", (".mf4", ".mdf", ".dat"), mf4_file.EXTRA, mf4_file.read, mf4_file.write),
    Format("MCAP", (".mcap",), mcap_file.EXTRA, mcap_file.read, mcap_file.write),
    Format("ROS bag", (".db3", ".bag"), ros_bag.EXTRA, ros_bag.read),
    Format("TDMS", (".tdms",), tdms_file.EXTRA, tdms_file.read),
    Format("MATLAB or HDF5", (".mat", ".h5", ".hdf5"), matlab_file.EXTRA, matlab_file.read),
)

_MF4_BEGINS: Final = (b"MDF", b"UnF")  # of a whole MF4 file and of one that was not closed; any other `.dat` is text

WRITTEN: Final = tuple(one.endings[0] for one in FORMATS if one.write)  # endings of files that can be written


def format_of(path: Path) -> Format | None:
    """The format that a file's name ends in, or of a folder that is a bag; None for others and for a `.dat` of text."""
    ending = ".db3" if ros_bag.is_bag(path) else path.suffix.lower()
    if ending == ".dat" and _begins(path) not in _MF4_BEGINS:
        return None
    return next((one for one in FORMATS if ending in one.endings), None)


def _begins(path: Path) -> bytes:
    """The first bytes of a file; those of an MF4 file where it cannot be read."""
    try:
        with opened(path, "record") as file:
            return file.read(3)
    except (ValueError, OSError):
        return _MF4_BEGINS[0]


def write_channels(path: Path, channels: Sequence[Channel]) -> bytes:
    """The content of a file `path` of a format that can be written. Raises ValueError of one sentence."""
    found = format_of(path)
    if found is None or found.write is None:
        raise ValueError(f"{path}: file must end in {', '.join(WRITTEN)}")
    with refusing(path, f"one that can be written as {found.name}"), tempfile.TemporaryDirectory() as folder:
        within = Path(folder) / f"file{path.suffix.lower()}"
        found.write(within, channels)
        return within.read_bytes()
