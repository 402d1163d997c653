"""A record of a rig from a file of any kind: what reads CAN logs is loaded only where one is read."""

from pathlib import Path

from hil.formats.reading import format_of, is_log
from hil.formats.record import channel_record
from models.records.record import Record, read_record
from models.rigs.rig import Rig


def read_rig_record(path: Path, rig: Rig, *, driven_only: bool = False, lenient: bool = False) -> Record:
    """A record of `rig` from a CSV file, a CAN log or a file of another format; `lenient`: see `read_record`."""
    if is_log(path):
        from hil.log.record import log_record

        return log_record(path, rig, driven_only=driven_only, lenient=lenient)
    if format_of(path):
        return channel_record(path, rig, driven_only=driven_only, lenient=lenient)
    return read_record(path, rig, driven_only=driven_only, lenient=lenient)
