"""The table `[reference]`: the wanted motion of the capsule, in mm and mm/s."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, Strict

from controller.limits import Limits
from controller.reference import LONGEST_S, STEP_S, Trajectory, by_positions, by_speeds, through
from models.files.toml import check_word, read_toml
from models.rigs.schema import NamedTable, Numbers, key

MM: Final = 1e-3  # in metres
FARTHEST: Final = 1e6  # Largest number in mm and mm/s that is read, so that nothing overflows; `[limits]` are narrower
FASTEST_HZ: Final = 0.1 / STEP_S  # ten steps of a trajectory in a period


Mm = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Places = Annotated[tuple[Mm, ...], Strict(False)]
START: Final = "time at which the move begins"


class ReferenceTable(NamedTable):
    """`[reference]` of one kind."""

    where = "reference"

    def trajectory(self, duration_s: float) -> Trajectory:
        """The reference over `duration_s`; ValueError where it does not fit."""
        raise NotImplementedError


class Ramp(ReferenceTable):
    """From `start_s` on at `speed_mm_s`."""

    speed_mm_s: Mm = key("speed of the move")
    start_s: float = key(START, 0.5)

    def trajectory(self, duration_s: float) -> Trajectory:
        return by_speeds([0.0, self.speed_mm_s * MM], [max(self.start_s, STEP_S), duration_s])


class Sine(ReferenceTable):
    """`amplitude (1 - cos(2 pi f t))/2` from `start_s` on: out and back, at rest at both ends."""

    amplitude_mm: Mm = key("distance out and back")
    frequency_Hz: float = key("frequency of the sine")
    start_s: float = key(START, 0.5)

    def trajectory(self, duration_s: float) -> Trajectory:
        if not 0 < self.frequency_Hz <= FASTEST_HZ:
            raise ValueError(f"reference.frequency_Hz must lie in (0, {FASTEST_HZ:g}]; got {self.frequency_Hz:g}")
        t = np.maximum(STEP_S * np.arange(round(duration_s / STEP_S) + 2) - self.start_s, 0.0)
        return Trajectory(0.5 * self.amplitude_mm * MM * (1 - np.cos(2 * np.pi * self.frequency_Hz * t)))


class Steps(ReferenceTable):
    """To `positions_mm` one after the other at `speed_mm_s`, with a rest of `dwell_s` at each."""

    positions_mm: Places = key("positions to visit in turn")
    speed_mm_s: Mm = key("speed of the move")
    dwell_s: float = key("rest at each position", 1.0, 0.0)
    start_s: float = key(START, 0.5)

    def trajectory(self, duration_s: float) -> Trajectory:
        if not self.positions_mm:
            raise ValueError("reference.positions_mm must be one position or more; got none")
        _in_time(self.positions_mm, self.speed_mm_s, self.start_s, self.dwell_s, duration_s)
        return through([MM * p for p in self.positions_mm], MM * self.speed_mm_s, self.dwell_s, self.start_s)


class Hold(ReferenceTable):
    """To `position_mm` at `speed_mm_s`, then stay there."""

    position_mm: Mm = key("position to hold", 0.0)
    speed_mm_s: Mm = key("speed of the move", 2.0)
    start_s: float = key(START, 0.5)

    def trajectory(self, duration_s: float) -> Trajectory:
        _in_time((self.position_mm,), self.speed_mm_s, self.start_s, 0.0, duration_s)
        return through([MM * self.position_mm], MM * self.speed_mm_s, 0.0, self.start_s)


class Waypoints(ReferenceTable):
    """`positions_mm` at `times_s`, straight lines between; corners are rounded over 50 ms."""

    times_s: Numbers = key("time of each position")
    positions_mm: Places = key("positions to visit in turn")

    def trajectory(self, duration_s: float) -> Trajectory:
        times, places = np.array([0.0, *self.times_s]), MM * np.array([0.0, *self.positions_mm])
        if len(self.times_s) != len(self.positions_mm) or not self.times_s or np.any(np.diff(times) < STEP_S):
            raise ValueError(
                f"reference.times_s must be as many as positions_mm, {STEP_S:g} s or more apart and after 0; got"
                f" {list(self.times_s)[:8]} and {len(self.positions_mm)} positions"
            )
        if times[-1] > duration_s + STEP_S:
            raise ValueError(f"reference.times_s must end within the run of {duration_s:g} s; got {times[-1]:g}")
        return by_positions(times.tolist(), places.tolist())


REFERENCES: Final[Mapping[str, type[ReferenceTable]]] = {
    one.__name__.lower(): one for one in (Ramp, Sine, Steps, Hold, Waypoints)
}


def read_reference(table: Mapping[str, Any], duration_s: float, limits: Limits | None = None) -> Trajectory:
    """The reference of a table over `duration_s`, within `limits` where given. Raises ValueError."""
    kind = check_word(table.get("kind"), "reference.kind", REFERENCES)
    shape = REFERENCES[kind](**{name: value for name, value in table.items() if name != "kind"})
    start = getattr(shape, "start_s", 0.0)
    if not 0 <= start < duration_s:
        raise ValueError(f"reference.start_s must lie from 0 on and within the run of {duration_s:g} s; got {start:g}")
    trajectory = shape.trajectory(duration_s)
    if limits is None:
        return trajectory
    speed = float(np.max(np.abs(np.diff(trajectory.positions)))) / STEP_S
    farthest = float(np.max(np.abs(trajectory.positions[: round(duration_s / STEP_S) + 1])))
    if speed > limits.speed_m_s * (1 + 1e-9):
        limit = f"limits.speed_m_s, {limits.speed_m_s / MM:g} mm/s"
        raise ValueError(f"reference must be no faster than {limit}; got {speed / MM:.4g} mm/s")
    if farthest > limits.travel_m:
        limit = f"limits.travel_m, {limits.travel_m / MM:g} mm"
        raise ValueError(f"reference must stay within {limit}; got {farthest / MM:.6g} mm")
    return trajectory


def with_reference(raw: Mapping[str, Any], file: Path | None, table: str) -> dict[str, Any]:
    """The tables `raw` with the [reference] of `file`, as close-loop writes it. The run (`duration_s` of `table`) lasts
    until the last waypoint, and checks are left out. Raises ValueError of one sentence.
    """
    if file is None:
        return dict(raw)
    given, _ = read_toml(file, "reference file")
    reference = given.get("reference")
    times = reference.get("times_s") if isinstance(reference, Mapping) else None
    if not isinstance(reference, Mapping) or reference.get("kind") != "waypoints" or not times:
        raise ValueError(
            f"{file}: reference file must have a table [reference] of kind 'waypoints' with times_s and positions_mm,"
            f" as close-loop writes next_experiment.toml; got {reference!r}"[:300]
        )
    try:
        shape = Waypoints(**{name: value for name, value in reference.items() if name != "kind"})
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    kept = {name: content for name, content in raw.items() if name != "checks"}
    run = raw.get(table, {})
    return {**kept, table: {**(run if isinstance(run, Mapping) else {}), "duration_s": shape.times_s[-1]}} | {
        "reference": dict(reference)
    }


def _in_time(
    positions_mm: tuple[float, ...], speed_mm_s: float, start_s: float, dwell_s: float, duration_s: float
) -> None:
    """Refuse moves that do not arrive within the run."""
    if not speed_mm_s > 0:
        raise ValueError(f"reference.speed_mm_s must be positive; got {speed_mm_s:g}")
    travel_mm = float(np.sum(np.abs(np.diff([0.0, *positions_mm]))))
    arrives = start_s + travel_mm / speed_mm_s + dwell_s * (len(positions_mm) - 1) if travel_mm else 0.0
    if arrives > min(duration_s, LONGEST_S) + STEP_S:
        raise ValueError(f"reference must arrive within the run of {duration_s:g} s; got {arrives:g} s until it does")
