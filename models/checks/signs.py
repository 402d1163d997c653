"""Signs and zeros, and exchanged columns: what friction shows of a force, or of a capsule that is led.
Over strokes in both directions it acts against the motion, equally far to both sides of the middle.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.checks.estimators import Array, regressed, step_noise, white_noise
from models.checks.excitation import silent_response
from models.checks.finding import Findings, RecordFinding
from models.checks.settings import SET
from models.checks.speeds import motion_rows
from models.checks.view import View
from models.rigs.columns import DRIVE_FORCE

_OF_MEDIAN = 1.253 / 0.6745  # standard error of a median by the median deviation and the root of the number


def check_force_sign(view: View) -> Findings:
    """Whether the force of a pull, a stage or a coil goes with the motion, as one that overcomes friction does."""
    moved = view.moving_column
    if view.kind.stage:
        column = view.measured if view.kind.imposed else str(view.driven)
        if _stage_reversed(view, view.record[column]):
            line = view.turned_line(column)
            yield view.stops("force_sign.stage", column, beside=moved, moved=moved, line=line)
    elif view.pushing is not None:
        column, force = view.pushing
        mean, n = _along(view, force)
        if mean:
            line = view.turned_line(column)
            yield view.stops("force_sign.stroke", column, beside=moved, moved=moved, line=line, mean=mean, n=n)
        elif view.kind.drawn:
            yield from _unsigned(view, column)


def check_cell_sign(view: View) -> Findings:
    """Whether a load cell between drive and capsule feels what the drive does: a magnet's gap, or a coil's push."""
    cell, drive = view.record.columns.get(DRIVE_FORCE), view.driven
    if cell is None or drive is None:
        return
    push = view.record[drive] - view.y if view.kind.follows else view.pushing[1] if view.pushing else view.record[drive]
    felt = np.isfinite(cell)
    if not felt.any() or not np.ptp(cell[felt]) or not np.ptp(push[felt]):
        return
    correlation = float(np.corrcoef(push[felt], cell[felt])[0, 1])
    if correlation <= SET.sign_against:
        line = view.turned_line(DRIVE_FORCE)
        yield view.stops("cell_sign", DRIVE_FORCE, beside=drive, correlation=correlation, line=line)


def _along(view: View, force: Array) -> tuple[float, int]:
    """Mean of a stroke's `force` in N towards its end, where friction has built up, times its direction, where that is
    surely negative, else 0; and the number of strokes.
    """
    strokes = view.strokes()
    if len(strokes) == 1:
        ((a, b, sign),) = strokes
        ends = np.array([sign * float(np.mean(piece)) for piece in np.array_split(force[(a + b) // 2 : b], 8)])
    else:
        ends = np.concatenate([sign * view.ends(force, sign) for sign in (1.0, -1.0)])
    if not len(ends):
        return 0.0, 0
    error = max(float(np.std(ends)) / np.sqrt(len(ends)), 3 * white_noise(force) / np.sqrt(len(force)), 1e-15)
    mean = float(np.mean(ends))
    against = mean < -SET.sure * error and mean < -SET.sign_mean * float(np.percentile(np.abs(force), 90))
    return mean if against else 0.0, len(strokes)


def _unsigned(view: View, column: str) -> Findings:
    """Whether a pull's force changes sign with the motion, as friction does: half the difference of the directions."""
    forward, backward = both = [view.ends(view.y, sign) for sign in (1.0, -1.0)]
    if min(map(len, both)) < SET.sign_strokes or silent_response(view):
        return
    turns = float(np.mean(forward) - np.mean(backward)) / 2
    error = float(np.hypot(*(np.std(ends) / np.sqrt(len(ends)) for ends in both))) / 2
    size = float(np.percentile(np.abs(view.y), 90))
    if size >= 20 * view.noise and abs(turns) + SET.sure / 2 * error <= SET.sign_turns * size:
        means = {"forward": np.mean(forward), "backward": np.mean(backward), "n": len(forward), "m": len(backward)}
        yield view.stops("force_unsigned", column, beside=view.moving_column, moved=view.moving_column, **means)


def _stage_reversed(view: View, force: Array) -> bool:
    """Whether mass and friction are both negative in a line through the force, and its work is."""
    rows = motion_rows(view)
    v = rows[:, 2]
    mass, friction, *_ = regressed(rows, force) * np.std(rows, axis=0)
    work, lost = float(np.sum(force * v)) * view.dt, float(np.sum(np.abs(force * v))) * view.dt
    light = mass < 0 or abs(mass) < SET.sign_weight * abs(friction)
    return bool(work < -SET.sign_work * lost and friction < 0 and light)


def check_drive_sign(view: View) -> Findings:
    """Whether the capsule moves in the direction of its magnet."""
    if not view.kind.follows or view.driven is None:
        return
    x, c = view.averaged(view.y, SET.mean_s), view.averaged(view.record[view.driven], SET.mean_s)
    if not np.ptp(x) or not np.ptp(c) or np.ptp(x) < max(20 * view.noise, SET.sign_follows * np.ptp(c)):
        return
    correlation = float(np.corrcoef(c, x)[0, 1])
    if correlation <= SET.sign_against:
        line = view.turned_line(view.measured)
        yield view.stops("drive_sign", beside=view.driven, correlation=correlation, line=line)


def check_same(view: View) -> Findings:
    """A measured column that repeats the driven one, perhaps in another unit."""
    if view.driven is None:
        return
    driven, span = view.record[view.driven], float(np.ptp(view.y))
    if not span or not np.ptp(driven):
        return
    slope, offset = np.polyfit(driven, view.y, 1)
    if float(np.max(np.abs(view.y - slope * driven - offset))) <= SET.same_column * span:
        line = view.columns_line(view.measured, column="...")
        yield view.stops("columns_same", beside=view.driven, slope=slope, limit=SET.same_column, line=line)


def check_pull_exchanged(view: View) -> Findings:
    """A stage is finer than a load cell, and friction turns with the motion; where neither holds, both are swapped."""
    speed = float(np.mean(np.abs(view.speed)))
    if not view.kind.drawn or view.driven is None or not speed:
        return
    position, noise = _coarse(view.record[view.driven]), _coarse(view.y)
    along = abs(float(np.mean(np.sign(view.y) * view.speed))) / speed
    if position > SET.exchanged_coarser * noise and along < SET.exchanged_along:
        yield _exchanged(view, view.driven, "columns_exchanged.pull", position=position, noise=noise, along=along)


def _coarse(x: Array) -> float:
    """Noise or resolution of a column as a share of its span."""
    span = float(np.ptp(np.percentile(x, (1, 99))))
    return max(white_noise(x), step_noise(x)) / span if span else 0.0


def _exchanged(view: View, driven: str, case: str, **values: Any) -> RecordFinding:
    """The finding that the measured column and the `driven` one are exchanged."""
    measured, sources = view.measured, view.rig.columns
    line, other = (
        view.columns_line(one, column=sources.entry(two).column)
        for one, two in ((measured, driven), (driven, measured))
    )
    return view.finding("stops", case, beside=driven, line=line, other=other.removeprefix("[columns] "), **values)


@dataclass(frozen=True)
class _Sides:
    """Medians of a signal over the later halves of the longer strokes: half the difference between the directions
    (`friction`), the mean of both (`middle`), and by how much these may be off by chance (`unsure`).
    """

    friction: float
    middle: float
    unsure: float

    @property
    def apart(self) -> bool:
        """Whether the middle is further off than friction can explain."""
        return bool(abs(self.middle) > SET.zero_clear * abs(self.friction) + self.unsure)


def _sides(view: View, signal: Array, noise: float) -> _Sides | None:
    """None where a direction has fewer than two strokes."""
    x = view.record[view.moving_column]
    strokes = [(sign, np.mean(signal[(a + b) // 2 : b]), abs(float(x[b - 1] - x[a]))) for a, b, sign in view.strokes()]
    least = float(np.median([length for *_, length in strokes])) if strokes else 0.0
    both = [np.array([mean for sign, mean, d in strokes if sign == side and d >= least]) for side in (1.0, -1.0)]
    if min(map(len, both)) < 2:
        return None
    ahead, back = (float(np.median(means)) for means in both)
    errors = (np.median(np.abs(means - np.median(means))) / np.sqrt(len(means)) for means in both)
    error = _OF_MEDIAN * float(np.hypot(*errors))
    return _Sides(0.5 * (ahead - back), 0.5 * (ahead + back), max(SET.sure * error, 3 * noise))


def check_place_zero(view: View) -> Findings:
    """Whether a magnet's capsule is behind its carriage in both directions, by the same distance."""
    if not view.kind.follows or view.driven is None:
        return
    sides = _sides(view, view.record[view.driven] - view.y, view.noise)
    late = SET.zero_late_s * float(np.percentile(np.abs(view.speed), 75))
    if sides is not None and -sides.friction > max(sides.unsure, late):
        lead = view.length(-sides.friction)
        yield _exchanged(view, view.driven, "columns_exchanged.magnet", lead=lead)
    elif sides is not None and sides.apart and not (view.rig.surface and view.rig.surface.kind == "air"):
        off = view.length(abs(sides.middle))
        line = _zero_line(view, -sides.middle)
        yield view.notes("zeros_apart.position", offset=off, ahead=sides.middle < 0, line=line)


def check_force_zero(view: View) -> Findings:
    """Whether the force of a pull is equally far from zero in both directions, as friction is."""
    sides = _sides(view, view.y, view.noise) if view.kind.drawn else None
    if sides is not None and sides.apart:
        offset, line = view.of_measured(sides.middle), _zero_line(view, sides.middle)
        yield view.notes("zeros_apart.force", offset=offset, line=line)


def _zero_line(view: View, offset: float) -> str:
    """The line of `[columns]` that takes `offset` off the measured column."""
    entry = view.rig.columns.entry(view.measured)
    zero = float(f"{entry.offset + offset / (entry.sign * entry.factor()):.3g}")
    return view.columns_line(view.measured, offset=zero)
