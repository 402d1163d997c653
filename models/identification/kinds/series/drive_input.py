"""A record's command in a model's steps: straight lines between samples, or a switch that holds between edges."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from models.drives.drive import Drive
from models.identification.kind import Array
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.columns import FURTHER, Further
from models.rigs.kinds import KINDS
from models.rigs.tables import ClockTable

SWITCH_DELAY = "switch_delay_s"
CLOCK_OFFSET = "clock_offset_s"
KEPT = 64
"""Records whose inputs are kept: a fit runs over the same ones thousands of times."""


def driven_column(kind: str, records: Sequence[Record]) -> str:
    """The first of a kind's alternative driven columns that all `records` have. Raises ValueError without any."""
    alternatives = records[0].layout.driven[0] if records else KINDS[kind].layout.driven[0]
    for name in alternatives:
        if all(name in record.columns for record in records):
            return name
    got = ", ".join(f"{r.name}: {next((n for n in alternatives if n in r.columns), 'neither')}" for r in records)
    known = " or ".join(alternatives)
    raise ValueError(f"records of one series must have one driven column, {known}, in common; got {got}")


def interval(record: Record) -> float:
    """Mean time between samples in s."""
    t = record["t_s"]
    return float(t[-1] - t[0]) / (len(t) - 1)


@lru_cache(maxsize=KEPT)
def evenly(record: Record, columns: tuple[str, ...]) -> Record:
    """`record` itself where its samples are even in time, else its `columns` at twice as many even times."""
    t = record["t_s"]
    if np.max(np.abs(t - np.linspace(t[0], t[-1], len(t)))) < SET.uneven * interval(record):
        return record
    even = np.linspace(t[0], t[-1], 2 * len(t) - 1)
    there = {name: np.interp(even, t, record[name]) for name in columns if name in record.columns}
    return Record(record.name, record.kind, {"t_s": even, **there}, began_s=record.began_s)


@dataclass(frozen=True)
class Feed:
    """A loop's `commands` every `dt` s in `substeps`; each `every`-th output from `first` on belongs to a sample."""

    commands: Array
    dt: float
    substeps: int
    first: int = 0
    every: int = 1

    def samples(self, output: Array) -> Array:
        """The loop's output at the record's samples."""
        return output[self.first :: self.every]


def internal_step(drive: Drive, rigid: bool, fine: bool = True) -> float:
    """Longest step in s of a model; `rigid`: the motion is imposed; `fine` steps keep the order of slip events."""
    if drive.launched:
        return float(SET.axis_step_s)
    if drive.held:  # a body that its drive shakes to and fro
        return 5e-5 if fine else 1e-4
    if rigid:  # samples that are further apart miss when a wall slips
        return 4e-3
    if not drive.anchored:  # the error of a step lasts
        return 2e-4
    if drive.imposed:  # behind an elastic link, solved implicitly; half of 1e-4's time, predictions 0.2 mN rms apart
        return 2e-4 if fine else 5e-4
    return 1e-4 if fine else 3.3e-4


def feed(drive: Drive, record: Record, rigid: bool, delay: float, fine: bool = True) -> Feed:
    """The loop's input for `record`; `delay` in s of a switch that is logged as on or off alone, `rigid` and `fine` as
    in `internal_step`.
    """
    dt = interval(record)
    pieces = max(1, round(dt / internal_step(drive, rigid, fine)))
    if not drive.stepped:
        return Feed(record[drive.commanded], dt, pieces)
    if not drive.held:
        kept = np.repeat(record[drive.commanded], pieces)[: (len(record) - 1) * pieces + 1]
        return Feed(kept, dt / pieces, 1, every=pieces)
    return Feed(_held(record, drive.commanded, pieces, delay), dt / pieces, 1, 1, pieces)


@lru_cache(maxsize=KEPT // 4)  # these are long
def _held(record: Record, column: str, pieces: int, delay: float) -> Array:
    """A switch's commands, from one step before the record to one after it."""
    command = record[column]
    mean = switched(command, interval(record), pieces, delay if logged_whole(command) else 0.0)
    return np.concatenate([[0.0], mean, mean[-1:]])


def _ends(command: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where a switch's column is fully off, and where fully on."""
    low, high = float(command.min()), float(command.max())
    margin = SET.switch_end * (high - low)
    return command <= low + margin, command >= high - margin


def logged_whole(command: Array) -> bool:
    """Whether a switch's column has only two values, which do not show when between two samples the switch went."""
    off, on = _ends(command)
    return bool(np.all(off | on))


def switched(command: Array, dt: float, pieces: int, delay: float) -> Array:
    """Mean of a switched command over each of `pieces` equal parts of every sampling interval `dt` in s, shape ((n - 1)
    pieces,), `delay` s late.

    A sample is the command's mean over the interval before it. Where a neighbour is fully on or off, an edge inside the
    interval gives that mean; elsewhere the mean holds throughout.
    """
    off, on = (np.append(where, False) for where in _ends(command))
    partial = ~(off | on)[1:-1]
    up, down = off[:-2] | on[2:], on[:-2] | off[2:]
    rises, falls = partial & up & ~down, partial & down & ~up
    share, low, high = command[1:], float(command.min()), float(command.max())
    first = np.where(rises, low, np.where(falls, high, share))
    then = np.where(rises, high, np.where(falls, low, share))
    turn = np.where(rises | falls, (then - share) / np.where(first == then, 1.0, then - first), 1.0)
    starts = np.arange(len(share))
    knots = np.append(np.stack([starts, starts + turn], axis=1).ravel(), float(len(share)))
    area = np.stack([turn * first, (1 - turn) * then], axis=1).ravel()
    total = np.concatenate([[0.0], np.cumsum(area)])
    at = np.arange(len(share) * pieces + 1) / pieces - delay / dt
    reached = np.interp(at, knots, total) + np.minimum(at, 0.0) * command[0]
    return np.asarray(np.diff(reached) * pieces)


def switch_delay(drive: Drive, records: Sequence[Record]) -> tuple[Parameter, ...]:
    """When in the sampling interval a switch acts that is logged as on or off, to be fitted."""
    if not drive.held:
        return ()
    dt = max((interval(record) for record in records), default=1.0)
    whole = bool(records) and all(logged_whole(record[drive.commanded]) for record in records)
    why = "a sample of a switch is the mean over the interval before it (0) or after it (one sampling interval)"
    return (Parameter(SWITCH_DELAY, 0.5 * dt, "s", 0.0, dt, why, fit=whole),)


def clock_offset(clock: ClockTable | None) -> tuple[Parameter, ...]:
    """The time by which the measured columns are stamped late, fitted with the rig file's value as prior."""
    if clock is None:
        return ()
    value, std, source = clock.offset_s, clock.offset_std_s, "[clock] of the rig file"
    return (Parameter(CLOCK_OFFSET, value, "s", value - 4 * std, value + 4 * std, source, fit=True, spread=std),)


def read_late(column: Further, clock: ClockTable | None) -> tuple[Parameter, ...]:
    """The time by which an instrument is stamped late, and the time constant of its filter (first order)."""
    if not column.instrument:
        return ()
    at, source = getattr(clock, column.key("offset_s"), 0.0), "[clock] of the rig file; within 20 ms"
    return (
        Parameter(column.key("clock_s"), at, "s", at - 0.02, at + 0.02, source, fit=True),
        Parameter(column.key("lowpass_s"), 0.0, "s", 0.0, 0.02, "a sensor without a filter", fit=True),
    )


OF_THE_LOG = (SWITCH_DELAY, CLOCK_OFFSET, *(p.name for one in FURTHER.values() for p in read_late(one, None)))
"""Parameters of the logging, not of the rig that a controller drives."""
