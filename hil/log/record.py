"""A CAN log as a record: the rig's driven and measured columns on one time base, decoded with the catalogue."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Final

import numpy as np

from hil.bus.catalogue import load_catalogue
from hil.bus.codec import Refusal, without_absent
from hil.bus.protection import Receiver
from hil.formats.channels import Array, Channel, Heading
from hil.formats.reading import format_of, is_log, read_channels
from hil.log.blf_file import RECEIVED, SENT, Tell
from hil.log.reader import read_frames
from hil.nodes.frame_map import CARRIAGE_MAP, FRAME_MAPS, FrameMap
from models.files.csv_reader import read_table
from models.files.units import split_unit
from models.records.clock import ClockError, LeftOut, in_order, left_out, one_clock
from models.records.record import Record, record_of
from models.rigs.columns import TIME
from models.rigs.kinds import KINDS
from models.rigs.mapping import ColumnMap
from models.rigs.rig import Rig

_CALENDAR_S: Final = 1e6  # a later stamp is a date
_ENABLE, _ENABLED, _DERATED = 2, 4, 5  # `Mode` of a command, and `State` of a drive that follows it
_SET_BACK_S: Final = 1.0  # a clock that goes back further begins again
_HEARTBEAT: Final = "Heartbeat"


@dataclass(frozen=True)
class Source:
    """The signal on the bus of a record's column."""

    column: str
    frame: str
    signal: str


@dataclass(frozen=True)
class Sources:
    """The driven and the measured column of a kind of rig; a `held` drive is constant between commands."""

    driven: Source
    measured: Source
    held: bool = False


_POSITION: Final = Source("position_m", "CapsuleLocalisation", "Position_m")
_FORCE: Final = Source("force_N", "ForceReading", "Force_N")


def _sources(one: FrameMap) -> Sources:
    frame = one.command if one.drive.shaken else one.feedback
    return Sources(Source(one.channel, frame, one.signal), _POSITION, one.drive.shaken)


_PULLED: Final = Sources(Source("position_m", CARRIAGE_MAP.feedback, CARRIAGE_MAP.signal), _FORCE)
SOURCES: Final[Mapping[str, Sources]] = {
    kind: sources
    for sources in (_PULLED, *map(_sources, FRAME_MAPS.values()))
    for kind, one in KINDS.items()
    if one.layout.measured == (sources.measured.column,) and sources.driven.column in sum(one.layout.driven, ())
}


def log_channels(path: Path, tell: Tell | None = None) -> list[Channel]:
    """Each signal of the good frames as a channel `Frame/Signal` at the times of arrival. Raises ValueError."""
    reading = _Reading(path, tell)
    channels: list[Channel] = []
    for name, frames in reading.good.items():
        times = np.array([t for t, _ in frames])
        kept, _ = in_order(times)
        if tell is not None and not kept.all():
            tell(left_out("stamps_astray", name, times[~kept], len(times)).sentence)
        heard = [without_absent(name, v) for _, v in frames]
        for one in reading.catalogue[name].fields:
            values = np.array([v[one.name] for v in heard], dtype=float)[kept]
            heading = Heading(f"{name}/{one.name}", one.unit, name, clocked=True, samples=len(values))
            channels.append(Channel(heading, values, times[kept]))
    if not channels:
        source = Path(reading.catalogue.source).name
        raise ValueError(f"{path}: log must hold frames of {source}; got none that is good")
    return channels


def log_record(path: Path, rig: Rig, *, driven_only: bool = False, lenient: bool = False) -> Record:
    """The record of `rig` in the log `path`. Its rows are the times of the measured values: arrival less the age in the
    frame. Feedback is interpolated linearly; a held drive is the mean of its commands since the previous row. Frames
    that the protection refuses and values that the sensor marks invalid are left out. With `driven_only` the rows may
    be the drive's. Raises ValueError of one sentence.
    """
    if rig.kind not in SOURCES:
        kinds = ", ".join(SOURCES)
        raise ValueError(f"{path}: CAN log must be of a rig of kind {kinds}; got kind {rig.kind!r}: give a CSV")
    notes: list[str] = []
    try:
        columns, lost = _columns(_Reading(path, notes.append), SOURCES[rig.kind], driven_only)
    except ClockError as error:
        raise ValueError(f"{path}: {error}") from None
    limit, rows, ours = KINDS[rig.kind].layout.limit, len(columns[TIME]), replace(rig, columns=ColumnMap())
    if rows > limit:
        raise ValueError(f"{path}: record of kind {rig.kind} must have at most {limit} rows; the log gives {rows}")
    told, where = tuple(notes), str(path)
    return record_of(
        path.stem, columns, ours, where=where, driven_only=driven_only, notes=told, lost=lost, lenient=lenient
    )


class _Reading:
    """The good frames of a log by name: arrival in s (calendar times: since the first frame), values."""

    def __init__(self, path: Path, tell: Tell | None) -> None:
        self.where, self.catalogue = str(path), load_catalogue()
        self.sentences: list[str] = []
        self.good: dict[str, list[tuple[float, dict[str, float]]]] = {}
        self.refused: dict[str, list[float]] = {}
        self.receivers = {frame.id: Receiver(frame) for frame in self.catalogue.frames.values()}
        start, heard, last = None, -inf, dict[int, bytes]()

        def heard_of(sentence: str) -> None:
            self.sentences.append(sentence)
            if tell is not None:
                tell(sentence)

        for logged in read_frames(path, heard_of):
            if start is None:
                start = logged.time_s if logged.time_s > _CALENDAR_S else 0.0
            receiver = self.receivers.get(logged.id)
            if receiver is None or logged.direction not in (RECEIVED, SENT):
                continue
            now = logged.time_s - start
            heard = max(heard, now) if now > heard - _SET_BACK_S else now  # a single wrong stamp stales no frame
            if last.get(logged.id) == logged.data:  # a log of two connections to one bus has each frame twice
                values: dict[str, float] | Refusal = Refusal("repeated")
                receiver.refused["repeated"] += 1
            else:
                values = receiver.accept(logged.data, heard)
            last[logged.id] = logged.data
            if isinstance(values, Refusal):
                self.refused.setdefault(receiver.frame.name, []).append(now)
            else:
                self._check_catalogue(receiver.frame.name, values)
                self.good.setdefault(receiver.frame.name, []).append((now, values))

    def _check_catalogue(self, name: str, values: Mapping[str, float]) -> None:
        known = self.catalogue.fingerprint
        if name.endswith(_HEARTBEAT) and values["Catalogue"] != known:
            got, source = int(values["Catalogue"]), Path(self.catalogue.source).name
            wanted = f"one of {source} with fingerprint {known:#06x}"
            raise ValueError(f"{self.where}: log must be {wanted}; got {got:#06x} in {name}")

    def told(self, name: str) -> LeftOut | None:
        """What is said of the refused frames of a name."""
        receiver, times = self.receivers[self.catalogue[name].id], np.array(self.refused.get(name, ()))
        why = ", ".join(f"{reason} ({count})" for reason, count in receiver.refused.items())
        return left_out("refused", name, times, len(times) + receiver.accepted, why=why) if len(times) else None

    def frames(self, name: str) -> list[tuple[float, dict[str, float]]]:
        """The good frames of a name. Raises ValueError that names the received ones instead."""
        if name in self.good:
            return self.good[name]
        frame = self.catalogue[name]
        refused = self.receivers[frame.id].refused
        source = Path(self.catalogue.source).name
        if refused:
            why = ", ".join(f"{count} for {reason}" for reason, count in refused.items())
            raise ValueError(f"{self.where}: {name} frames must be as {source} describes them; all were refused: {why}")
        there = ", ".join(sorted(n for n in self.good if not n.endswith(_HEARTBEAT))) or "no frame of the catalogue"
        told = "".join(f"; {sentence}" for sentence in self.sentences)
        raise ValueError(f"{self.where}: log must hold {name} frames ({frame.id:#x} of {source}); got {there}{told}")


def _columns(reading: _Reading, sources: Sources, driven_only: bool) -> tuple[dict[str, Array], tuple[LeftOut, ...]]:
    """The record's columns on one clock, and what was left out."""
    driven, measured = reading.frames(sources.driven.frame), sources.measured
    lost, samples = [reading.told(sources.driven.frame)], dict[str, tuple[Array, Array]]()
    if not driven_only or measured.frame in reading.good:
        samples[measured.column], invalid = _measured(reading, measured)
        lost += [reading.told(measured.frame), invalid]
    t = np.array([t for t, _ in driven])
    if sources.held:
        t, values = _commanded(reading, driven)
        if samples and samples[measured.column][0][-1] > t[-1]:  # the last command has lapsed by then
            t, values = np.append(t, samples[measured.column][0][-1]), np.append(values, 0.0)
    else:
        values = np.array([v[sources.driven.signal] for _, v in driven])
    samples[sources.driven.column] = t, values
    columns, _, left = one_clock(samples, next(iter(samples)), (sources.driven.column,) if sources.held else ())
    if sources.held:
        columns[sources.driven.column] = np.clip(columns[sources.driven.column], 0.0, 1.0)
    return columns, (*(one for one in lost if one is not None), *left)


def _measured(reading: _Reading, source: Source) -> tuple[tuple[Array, Array], LeftOut | None]:
    """The times at which the values were measured, and the values; what is said of invalid ones."""
    frames = reading.frames(source.frame)
    found = [(t - v["Age_s"], v[source.signal]) for t, v in frames if v["Valid"]]
    if not found:
        raise ValueError(f"{reading.where}: {source.frame} must hold values with Valid 1; got none")
    times, values = np.array(found).T
    bad = np.array([t for t, v in frames if not v["Valid"]])
    return (times, values), left_out("invalid", source.column, bad, len(frames)) if len(bad) else None


def _commanded(reading: _Reading, frames: list[tuple[float, dict[str, float]]]) -> tuple[Array, Array]:
    """Times of changes of the level, and the levels: those of valid commands while the drive is enabled, else 0."""
    states = reading.good.get("InnerMassFeedback", [(0.0, {"State": float(_ENABLED)})])
    at = np.searchsorted(np.array([t for t, _ in states]), np.array([t for t, _ in frames]), "right") - 1
    runs = [states[max(k, 0)][1]["State"] in (_ENABLED, _DERATED) for k in at.tolist()]
    times, levels = list[float](), list[float]()
    for (t, v), on, later in zip(frames, runs, [*(t for t, _ in frames[1:]), np.inf], strict=True):
        if v["Period_s"]:
            wanted = "InnerMassCommand must hold a level (Period_s 0) in a record"
            raise ValueError(f"{reading.where}: {wanted}; got {v['Period_s']:g} s")
        if v["Level"] < 0:
            raise ValueError(f"{reading.where}: Level must lie in [0, 1] in a record; got {v['Level']:g} at {t:g} s")
        times.append(t)
        levels.append(v["Level"] if v["Mode"] == _ENABLE and on else 0.0)
        if later > t + v["TimeToLive_ms"] * 1e-3:
            times.append(t + v["TimeToLive_ms"] * 1e-3)
            levels.append(0.0)
    return np.array(times), np.array(levels)


def file_channels(path: Path, tell: Tell | None = None) -> list[Channel]:
    """All channels of numbers in a file; `tell`: see `read_frames`. Raises ValueError of one sentence."""
    if is_log(path):
        return log_channels(path, tell)
    if format_of(path) is not None:
        channels = read_channels(path, lambda found: [one.name for one in found])
    else:
        table = read_table(path, lambda names, units: ())
        channels = [
            Channel(Heading(name, table.units.get(name) or split_unit(name)[1]), values)
            for name, values in zip(table.header, table.values.T, strict=True)
            if name and not np.isnan(values).all()
        ]
    if len(channels) < 2 or not any(len(channel.values) for channel in channels):
        raise ValueError(f"{path}: record must have two columns of numbers or more; got {len(channels)}")
    return channels
