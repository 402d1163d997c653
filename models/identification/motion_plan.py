"""Drives that a rig can make: moves between positions with rests, or pieces of what its records were driven with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from models.identification.kind import Array
from models.identification.kinds.series.drive_input import interval
from models.identification.kinds.series.series import SeriesKind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class Room:
    """The range of a motion of a `kind` of rig: positions of the records, from `low` to `high` in m, beginning at
    `start`; up to `speed` in m/s (up to four times theirs, as long as that is at most 10 mm/s); `length` in s, sampled
    every `dt` s in `column`.
    """

    kind: str
    column: str
    low: float
    high: float
    start: float
    speed: float
    length: float
    dt: float

    @classmethod
    def of(cls, records: Sequence[Record], column: str) -> Room:
        """The range of `records`; a motion is half as long as they are on average."""
        positions = np.concatenate([r[column] for r in records])
        dt = float(np.median(list(map(interval, records))))
        lengths = [float(r["t_s"][-1] - r["t_s"][0]) for r in records]
        speeds = np.abs(np.concatenate([_speeds(r, column) for r in records]))
        moving = speeds[speeds > SET.plan_moves * speeds.max(initial=0.0)]
        fast = float(np.percentile(moving, SET.plan_fast)) if len(moving) else 0.0
        fastest = max(fast, min(SET.plan_faster * fast, SET.plan_usual_m_s))
        length = float(np.clip(0.5 * np.mean(lengths), SET.plan_shortest_s, SET.plan_longest_s))
        low, high = float(positions.min()), float(positions.max())
        return cls(records[0].kind, column, low, high, float(records[0][column][0]), fastest, length, dt)

    def random(self, rng: np.random.Generator, begun: Sequence[Move] = ()) -> Plan:
        """The moves `begun` as long as there is time, then random ones until the time is over."""
        moves, here, left = [], self.start, self.length
        waiting = list(begun)
        while left > 0:
            move = waiting.pop(0) if waiting else _random_move(self, here, rng)
            left -= abs(move.position - here) / move.speed + move.rest
            moves.append(move)
            here = move.position
        return Plan(self, tuple(moves))

    @property
    def span(self) -> float:
        """From end to end in m."""
        return self.high - self.low


def _speeds(record: Record, column: str) -> Array:
    """Mean speeds in m/s over windows of `SET.plan_over_s`."""
    dt = interval(record)
    n = max(1, min(round(SET.plan_over_s / dt), len(record) - 1))
    x = record[column]
    return np.asarray((x[n:] - x[:-n]) / (n * dt))


@dataclass(frozen=True)
class Move:
    """To `position` in m at `speed` in m/s, then a rest of `rest` s."""

    position: float
    speed: float
    rest: float


@dataclass(frozen=True)
class Plan:
    """Moves one after the other, cut off where the room's time is over."""

    room: Room
    moves: tuple[Move, ...]
    beyond: ClassVar[float] = 0.0

    def varied(self, rng: np.random.Generator) -> Plan:
        """The same with one or two of its moves changed, left out or added."""
        room, moves = self.room, list(self.moves)
        for _ in range(int(rng.integers(1, 3))):
            k = int(rng.integers(len(moves)))
            here = moves[k - 1].position if k else room.start
            match int(rng.integers(5)):
                case 0:
                    moves[k] = _random_move(room, here, rng)
                case 1:
                    moves.insert(k, _random_move(room, here, rng))
                case 2 if len(moves) > 1:
                    del moves[k]
                case 3:
                    speed = float(
                        np.clip(moves[k].speed * np.exp(rng.normal(0, 0.5)), SET.slow * room.speed, room.speed)
                    )
                    moves[k] = replace(moves[k], speed=speed)
                case _:
                    moves[k] = replace(moves[k], rest=_random_rest(room, rng))
        return room.random(rng, moves)

    def waypoints(self) -> tuple[Array, Array]:
        """Times in s (n,) from 0 to the length, and the positions in m (n,)."""
        times, positions = [0.0, 0.3], [self.room.start, self.room.start]
        for move in self.moves:
            if move.position != positions[-1]:
                times.append(times[-1] + abs(move.position - positions[-1]) / move.speed)
                positions.append(move.position)
            if move.rest > 0:
                times.append(times[-1] + move.rest)
                positions.append(positions[-1])
        end = float(np.interp(self.room.length, times, positions))
        kept = [(t, x) for t, x in zip(times, positions, strict=True) if t < self.room.length - SET.ramp_s]
        t, x = zip(*kept, (self.room.length, end), strict=True)
        return np.array(t), np.array(x)

    @property
    def motion(self) -> Record:
        """The motion as the driven column of a record, corners rounded."""
        room = self.room
        n = round(room.length / room.dt) + 1
        t = room.dt * np.arange(n)
        width = max(1, round(SET.ramp_s / room.dt))
        before = np.interp(np.arange(-width + 1, n) * room.dt, *self.waypoints())
        sums = np.cumsum(np.concatenate([[0.0], before]))
        return Record(
            "next experiment",
            room.kind,
            {"t_s": np.asarray(t), room.column: np.asarray((sums[width:] - sums[:-width]) / width)},
        )


def _random_move(room: Room, here: float, rng: np.random.Generator) -> Move:
    speed = room.speed * float(np.exp(rng.uniform(np.log(SET.slow), 0.0)))
    farthest = min(room.span, SET.plan_long_move * room.length * speed)
    if rng.random() < SET.plan_turns:
        farthest = min(farthest, SET.plan_small * room.span)
    distance = float(rng.uniform(0.3, 1.0)) * farthest
    up, down = here + distance <= room.high, here - distance >= room.low
    sign = 1.0 if up and not down else -1.0 if down and not up else float(rng.choice((-1.0, 1.0)))
    return Move(float(np.clip(here + sign * distance, room.low, room.high)), speed, _random_rest(room, rng))


def _random_rest(room: Room, rng: np.random.Generator) -> float:
    return float(min(rng.choice(SET.plan_rests_s), SET.plan_long_move * room.length))


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
        """The command as the driven column of a record, with the places that the model expects."""
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
