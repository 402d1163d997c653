"""A record of a rig from a file of any kind; what reads CAN logs is loaded only where one is read."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hil.formats.channels import Array, Channel, Heading, RefusedError, refusing
from hil.formats.reading import format_of, is_log, read_channels
from models.records.clock import ClockError, LeftOut, one_clock
from models.records.record import SWITCHES, Record, find_columns, read_record, record_of
from models.rigs.columns import TIME
from models.rigs.kinds import KINDS
from models.rigs.mapping import ColumnMap, MappedColumn
from models.rigs.rig import Rig


def read_rig_record(path: Path, rig: Rig, *, driven_only: bool = False, lenient: bool = False) -> Record:
    """A record of `rig` from a CSV file, a CAN log or a file of another format; `lenient`: see `read_record`."""
    if is_log(path):
        from hil.log.record import log_record

        return log_record(path, rig, driven_only=driven_only, lenient=lenient)
    if format_of(path):
        return channel_record(path, rig, driven_only=driven_only, lenient=lenient)
    return read_record(path, rig, driven_only=driven_only, lenient=lenient)


_CALENDAR_S = 1e6  # a later stamp is a date


def channel_record(path: Path, rig: Rig, *, driven_only: bool = False, lenient: bool = False) -> Record:
    """The record of `rig` in a file, with columns by the table `[columns]`. Raises ValueError of one sentence."""
    choice = _Choice(path, rig, driven_only)
    channels = {channel.heading.name: channel for channel in read_channels(path, choice.pick)}
    with refusing(path, "a measurement"):
        columns, notes, lost = _columns(choice, channels)
    plain, where = replace(rig, columns=ColumnMap()), str(path)
    return record_of(
        path.stem, columns, plain, where=where, driven_only=driven_only, notes=notes, lost=lost, lenient=lenient
    )


@dataclass
class _Choice:
    """The channels of a file that are our columns."""

    path: Path
    rig: Rig
    driven_only: bool
    sources: dict[str, MappedColumn] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    clocked: bool = False

    def pick(self, headings: Sequence[Heading]) -> Collection[str]:
        """The channels to read; if they have clocks, `t_s` need not be one of them."""
        self.units = {heading.name: heading.unit for heading in headings}
        header = [heading.name for heading in headings]
        mapped = {entry.target: entry.column for entry in self.rig.columns.entries}
        self.clocked = mapped.get(TIME, TIME) not in header and any(heading.clocked for heading in headings)
        found = [*header, TIME] if self.clocked else header
        rig = self.rig
        if self.clocked:
            entries = tuple(entry for entry in rig.columns.entries if entry.target != TIME)
            rig = replace(rig, columns=ColumnMap(entries))
        self.sources = find_columns(str(self.path), rig, found, self.units, self.driven_only)
        if self.clocked:
            self.sources.pop(TIME, None)
        return {source.column for source in self.sources.values()}


def _columns(
    choice: _Choice, channels: Mapping[str, Channel]
) -> tuple[dict[str, Array], tuple[str, ...], tuple[LeftOut, ...]]:
    """Our columns in our units, of one length; notes on the resampling, and what was left out."""
    for target, source in choice.sources.items():
        if source.column and source.column not in channels:
            raise RefusedError(f"channel {source.column} ({target}) must hold numbers, one a sample; it does not")
    ours = {
        target: source.values(channels[source.column].values, choice.units.get(source.column, ""))
        for target, source in choice.sources.items()
        if source.column
    }
    for target, source in choice.sources.items():
        if not source.column:  # a stated rate
            ours[target] = source.values(next(iter(ours.values())))
    kind = KINDS[choice.rig.kind]
    if not (kind.layout.time and choice.clocked):
        lengths = {target: len(values) for target, values in ours.items()}
        if len(set(lengths.values())) > 1:
            raise RefusedError(f"columns must have one length; got {lengths}"[:300])
        if TIME in ours:
            ours[TIME] = since_start(ours[TIME])
        return ours, (), ()
    samples: dict[str, tuple[Array, Array]] = {}
    for target, values in ours.items():
        times = channels[choice.sources[target].column].time_s
        if times is None:
            raise RefusedError(f"channel of {target} must have a clock as the others have; it has none: map t_s, too")
        samples[target] = times, values
    first = next(iter(samples.values()))[0]
    if all(np.array_equal(times, first) for times, _ in samples.values()):
        return {TIME: since_start(first), **ours}, (), ()
    measured = [name for name in kind.columns(samples).measured if name in samples]
    try:
        columns, notes, lost = one_clock(samples, next(iter(measured or samples)), SWITCHES)
    except ClockError as error:
        raise RefusedError(str(error)) from None
    return {**columns, TIME: since_start(columns[TIME])}, notes, lost


def since_start(times: Array) -> Array:
    """Calendar times as times since the first of them; other times unchanged."""
    return times - times[0] if times.size and times[0] > _CALENDAR_S else times
