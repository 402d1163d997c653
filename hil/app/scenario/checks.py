"""The table `[checks]`: limits of a closed-loop run for all controllers or, as `[checks.mpc]`, for one."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from controller.reference import STEP_S, Trajectory
from controller.registry import CONTROLLERS, leads
from models.files.toml import check_word
from models.rigs.schema import NamedTable
from plant.session import Instruments

Table = Mapping[str, Any]
Span = tuple[float, float]
_AT_REST: Final = 1e-7  # m/s


Bound = Annotated[float, Field(ge=0)] | None


class TrackChecks(NamedTable):
    """Upper limits of the score of `capsule track`; None: not judged. Errors are those of the true position from
    `[control] judged_from_s` on.

    `drift_mm`: distance of the outermost positions from `drift_from_s` on (else from `judged_from_s`).
    `recovered_within_s`: time after the last drop-out or NaN until the error stays below `recovered_mm` for a second.
    `settled_within_s`: time after each arrival of the reference until the error stays below `settled_mm`.
    `speed_error_percent`: error of the mean speed from `speed_after_s` after each change of the reference's speed on.
    `failed_ticks`: ticks late, failed or stopped; `lost_ticks`: ticks without an estimate.
    """

    where = "checks"
    rmse_mm: Bound = None
    worst_mm: Bound = None
    final_mm: Bound = None
    wall_force_mN: Bound = None
    hard_violations: Bound = None
    lost_ticks: Bound = None
    failed_ticks: Bound = None
    drift_mm: Bound = None
    recovered_within_s: Bound = None
    settled_within_s: Bound = None
    speed_error_percent: Bound = None
    drift_from_s: Bound = None
    recovered_mm: Bound = None
    settled_mm: Bound = None
    speed_after_s: Annotated[float, Field(ge=0)] = 3.0


def read_checks(
    table: Table, kind: str, reference: Trajectory, instruments: Instruments, judged_from_s: float, duration_s: float
) -> Mapping[str, TrackChecks]:
    """`[checks]` by controller: the common ones, then its own. Raises ValueError, also for what no run can decide."""
    able = [name for name in CONTROLLERS if kind in leads(name)]
    shared = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    tables = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    for name in tables:
        check_word(name, f"table of [checks] for a {kind} rig", able)
    fault_s = last_fault_s(instruments)

    def read(numbers: Table, where: str) -> TrackChecks:
        try:
            checks = TrackChecks(**numbers)
        except ValueError as error:
            raise ValueError(str(error).replace("checks", where, 1)) from None
        for within, size in (("recovered_within_s", "recovered_mm"), ("settled_within_s", "settled_mm")):
            if (getattr(checks, within) is None) != (getattr(checks, size) is None):
                raise ValueError(f"{where}.{within} must stand with {size}, and the other way round; got one of them")
        recovered = fault_s is not None and fault_s + (checks.recovered_within_s or 0.0) < duration_s
        fault = "none" if fault_s is None else f"{fault_s:g} s"
        begin, after = checks.drift_from_s, checks.speed_after_s
        begin = judged_from_s if begin is None else begin
        still = np.abs(_speeds(reference, duration_s))[round(begin / STEP_S) :] < _AT_REST
        even = any(end - start > after for (start, end), _ in legs(reference, duration_s))
        settles, whole = bool(rests(reference, duration_s)), f"a reference at rest from {begin:g} s to the end"
        for name, good, needed, got in (
            ("recovered_within_s", recovered, "the end of a drop-out or NaN early enough in the run", fault),
            ("settled_within_s", settles, "a reference that comes to rest", "one that does not"),
            ("drift_mm", still.size and still.all(), whole, "one that moves"),
            ("speed_error_percent", even, f"a reference at one speed for over {after:g} s", "none"),
        ):
            if getattr(checks, name) is not None and not good:
                raise ValueError(f"{where}.{name} must have {needed}; got {got}")
        return checks

    own = {name: read({**shared, **numbers}, f"checks.{name}") for name, numbers in tables.items()}
    return {**dict.fromkeys(able, read(shared, "checks")), **own}


def last_fault_s(instruments: Instruments) -> float | None:
    """When the last drop-out or NaN of an instrument ends; None where there is none."""
    sources = [one for one in (instruments.localisation, instruments.feedback) if one is not None]
    spans = [(spans[::2], spans[1::2]) for one in sources for spans in (one.gaps_s, one.nan_s)]
    ends = [start + length for starts, lengths in spans for start, length in zip(starts, lengths, strict=True)]
    return max(ends, default=None)


def rests(reference: Trajectory, duration_s: float) -> list[Span]:
    """Intervals in s in which the reference rests after it moved."""
    still = np.abs(_speeds(reference, duration_s)) < _AT_REST
    return [span for span, rest in _stretches(still) if rest and span[0] > 0]


def legs(reference: Trajectory, duration_s: float) -> list[tuple[Span, float]]:
    """Intervals in s in which the reference moves at one speed, and the speed in m/s."""
    speed = _speeds(reference, duration_s)
    even = np.append(np.abs(np.diff(speed)) < _AT_REST, True)
    return [
        (span, float(speed[round(span[0] / STEP_S)]))
        for span, steady in _stretches(even)
        if steady and abs(speed[round(span[0] / STEP_S)]) > _AT_REST
    ]


def _speeds(reference: Trajectory, duration_s: float) -> NDArray[np.float64]:
    return reference.speed(np.asarray(STEP_S * (np.arange(round(duration_s / STEP_S)) + 0.5), dtype=np.float64))


def _stretches(flags: NDArray[np.bool_]) -> list[tuple[Span, bool]]:
    edges = [0, *(np.flatnonzero(np.diff(flags)) + 1).tolist(), flags.size]
    return [((a * STEP_S, b * STEP_S), bool(flags[a])) for a, b in pairwise(edges) if b > a]
