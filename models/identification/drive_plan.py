"""Commands for a rig whose capsule no carriage leads, a coil or a shaken mass: pieces of what its records were driven
with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.identification.kind import Array
from models.identification.kinds.series.drive_input import interval
from models.identification.kinds.series.series import SeriesKind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class DriveRoom:
    """The drives of `records` in `column`, for a model of `kind` with the values `theta`."""

    kind: SeriesKind
    records: tuple[Record, ...]
    theta: Theta
    column: str

    @property
    def dt(self) -> float:
        """Usual time between samples in s."""
        return float(np.median(list(map(interval, self.records))))

    @property
    def switched(self) -> bool:
        """Whether the drive is only on or off."""
        return all(np.all((r[self.column] >= 0) & (r[self.column] <= 1)) for r in self.records)

    def random(self, rng: np.random.Generator, begun: Sequence[Array] = ()) -> DrivePlan:
        """The pieces `begun` and random ones: stretches of the records' drives, faster or slower, weaker, turned (a
        switch: on where it was off), or a rest.
        """
        pieces = list(begun)
        while sum(map(len, pieces)) * self.dt < SET.plan_shortest_s:
            record = self.records[int(rng.integers(len(self.records)))]
            seconds, faster = rng.uniform(*SET.plan_pieces_s), SET.plan_piece_faster ** rng.uniform(-1, 1)
            begin = rng.uniform(record["t_s"][0], max(record["t_s"][-1] - seconds * faster, record["t_s"][0]))
            at = begin + faster * np.arange(0.0, seconds, self.dt)
            drive, turned = np.interp(at, record["t_s"], record[self.column]), rng.random() < 0.5
            if self.switched:
                drive = np.round(1 - drive if turned else drive)
            else:
                drive = drive * rng.uniform(0.5, 1.0) * (-1 if turned else 1)
            pieces.append(np.zeros(len(at)) if rng.random() < SET.plan_piece_rests else drive)
        return DrivePlan(self, tuple(pieces))


@dataclass(frozen=True)
class DrivePlan:
    """Pieces of a command one after the other."""

    room: DriveRoom
    pieces: tuple[Array, ...]

    def varied(self, rng: np.random.Generator) -> DrivePlan:
        """Another plan that begins as this one does."""
        return self.room.random(rng, self.pieces[: int(rng.integers(len(self.pieces)))])

    @cached_property
    def motion(self) -> Record:
        """The command as the driven column of a record, with the places that the model expects from where the first
        record begins.
        """
        room, kind = self.room, self.room.kind
        drive = np.concatenate(self.pieces, dtype=np.float64)[: round(SET.plan_shortest_s / room.dt) + 1]
        t = np.asarray(room.dt * np.arange(len(drive)))
        plain = Record("next experiment", kind.name, {"t_s": t, room.column: drive})
        start = float(room.records[0][kind.quantity][0])
        return plain.with_column(kind.quantity, start + kind.predict(plain, room.theta))

    @property
    def beyond(self) -> float:
        """By how many m the model expects the capsule more than an eighth of their span outside the records' places."""
        places = np.concatenate([record[self.room.kind.quantity] for record in self.room.records])
        low, high = places.min() - np.ptp(places) / 8, places.max() + np.ptp(places) / 8
        expected = self.motion[self.room.kind.quantity]
        return float(max(low - expected.min(), expected.max() - high, 0.0))

    def waypoints(self) -> tuple[Array, Array]:
        """Times in s (n,), and where the model expects the capsule in m (n,)."""
        some = np.unique(np.linspace(0, len(self.motion) - 1, round(2 * SET.plan_shortest_s) + 1).astype(np.intp))
        return self.motion["t_s"][some], self.motion[self.room.kind.quantity][some]
