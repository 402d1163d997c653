"""Which samples of a measured column a fit may use: the record on one clock, its bad samples filled in, and its start
left out where it begins in motion or under the load of an earlier motion.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from models.checks.estimators import Mask, runs_of
from models.checks.finding import Findings
from models.checks.positions import POSITIONS, without_slips, without_steps
from models.checks.sensor import clipped, fresh, off, silent, spikes, straight_over
from models.checks.settings import SET
from models.checks.view import TEXT, View, once
from models.records.record import USED, Record, where_measured
from models.rigs.benches import AXIS
from models.rigs.columns import TIME
from models.rigs.rig import Rig

RUN_IN = "_run_in"
"""Column of a record that counts from some row on: 1 in the rows before, which are only simulated."""


def on_one_clock(record: Record, rig: Rig) -> Record:
    """`record` with the drift of `[clock]` taken out: measured values keep their rows and get the stamps of the driven
    columns' clock, `t - drift (t - t_0)`, at which the driven columns are interpolated; later rows are left out.
    Unchanged where no drift is stated, or where stamps do not rise, which the checks refuse.
    """
    if rig.clock is None or not rig.clock.drift or TIME not in record.columns or np.any(np.diff(record[TIME]) <= 0):
        return record
    logged = record[TIME]
    true = logged - rig.clock.drift * (logged - logged[0])
    for name in {name for names in record.layout.driven for name in names if name in record.columns}:
        record = record.with_column(name, np.interp(true, logged, record[name]))
    return record.with_column(TIME, true).rows(slice(int(np.searchsorted(true, logged[-1], side="right"))))


def treated(record: Record, case: str, **values: Any) -> Record:
    """`record`, which says that this was done to it."""
    return replace(record, treated=(*(record.treated or ()), TEXT(f"treated.{case}", **values)))


@once
def usable(view: View) -> Mask:
    """Where the measured column holds a value of its own: new, not clipped, no outlier, not filled in."""
    return np.asarray(fresh(view) & ~clipped(view) & ~off(view) & ~silent(view))


def cleaned(record: Record, rig: Rig) -> Record:
    """`record` with unusable samples of its measured and driven columns interpolated, and columns that say which
    measured values count and which rows are only simulated; it says what was done to it. A record that was cleaned
    stays as it is.
    """
    if record.treated is not None:
        return record
    logged, record = record, on_one_clock(record, rig)
    if record is not logged and rig.clock:
        record = treated(record, "clock", drift=rig.clock.drift)
    view = View(record, rig)
    if not view.timed or view.measured not in record.columns:
        return replace(record, treated=record.treated or ())
    good = used(record)
    good[good] = usable(view.of(where_measured(record)))
    if not good.all() and good.sum() > 2:
        record = filled(record.with_column(USED, good), view.measured)
        record = treated(record, "left_out", column=view.measured, n=int(np.sum(~good)), total=len(good))
    if rows := run_in(view):
        record = treated(from_row(record, rows), "run_in", seconds=rows * view.dt)
    record = _over_pauses(view, record)
    view = view.of(record)
    if view.driven and (apart := spikes(view, view.driven)).any():
        record = straight_over(record, view.driven, apart)
        record = treated(record, "straightened", column=view.driven, n=int(np.sum(apart)))
    if view.kind.stage and view.moving_column in record.columns:
        place, n = without_slips(view, view.moving_column)
        if n:
            record = treated(record.with_column(view.moving_column, place), "stepless", n=n)
            view = View(record, rig)
    if view.driven in POSITIONS:
        position = without_steps(view, record[view.driven])
        if position is not record[view.driven]:
            record = treated(record.with_column(view.driven, position), "smoothed", column=view.driven)
    return replace(record, treated=record.treated or ())


def _over_pauses(view: View, record: Record) -> Record:
    """`record` with rows over its pauses, which do not count, nor do those until a wall and a magnet have settled
    again; where nothing brings the body back, or most of it would be such rows, its longest piece without a pause.
    """
    t = record[TIME]
    steps = np.diff(t)
    pauses = np.flatnonzero(steps > SET.stamps_pause * view.dt)
    if not len(pauses) or view.kind is AXIS:
        return record
    edges = [0, *(pauses + 1), len(t)]
    more = int(np.sum(steps[pauses] / view.dt))
    if more > len(t) or not (view.kind.follows or view.kind.drawn):
        first, last = max(pairwise(edges), key=lambda piece: piece[1] - piece[0])
        return treated(record.rows(slice(first, last)), "piece", total=len(t), start=t[first], end=t[last - 1])
    between = [np.linspace(t[k], t[k + 1], round(steps[k] / view.dt) + 1)[1:-1] for k in pauses.tolist()]
    times = np.union1d(t, np.concatenate(between))
    own = np.isin(times, t)
    columns = {name: np.interp(times, t, values) for name, values in record.columns.items()}
    count, distance = own & (columns.get(USED, np.ones(len(times))) > 0), _settled_m(view)
    path = np.cumsum(np.abs(np.diff(columns[str(view.driven)], prepend=columns[str(view.driven)][0])))
    for end in t[pauses + 1]:
        begin = int(np.searchsorted(times, end))
        count[begin : int(np.searchsorted(path, path[begin] + distance))] = False
    lines = None if record.lines is None else record.lines[np.searchsorted(t, times, side="right") - 1]
    whole = replace(record, columns={**columns, TIME: times, USED: count.astype(float)}, lines=lines)
    return treated(whole, "pauses", n=len(pauses), seconds=float(np.sum(steps[pauses])), distance=distance)


def _settled_m(view: View) -> float:
    """The travel in m after which a wall, and behind a magnet the gap, are as in motion."""
    return float(SET.wall_settled_m if view.kind.drawn else SET.settled_m)


def used(record: Record) -> Mask:
    """The rows of a record whose measured value counts; all of one that was not cleaned."""
    return record[USED] > SET.usable_whole if USED in record.columns else np.ones(len(record), dtype=bool)


def gone(record: Record) -> Mask:
    """The rows in which the sensor gives no value for longer than usual: an observer has to run free there."""
    good = used(record)
    if good.all() or not good.any():
        return ~good
    usual = float(np.median(np.diff(np.flatnonzero(good)))) if good.sum() > 1 else 1.0
    least = max(SET.gone_s / max(float(np.median(np.diff(record[TIME]))), 1e-12), SET.gone_intervals * usual)
    mask = np.zeros(len(record), dtype=bool)
    for a, b in runs_of(~good, least):
        mask[a:b] = True
    return mask


def counted(record: Record) -> Mask:
    """The rows of a record whose residuals count: used, and no run-in."""
    return used(record) & (record[RUN_IN] < SET.usable_whole) if RUN_IN in record.columns else used(record)


def lead_in_s(record: Record) -> float:
    """How long in s a record is simulated before its residuals count."""
    rows = counted(record)
    return float(record[TIME][np.argmax(rows)] - record[TIME][0]) if rows.any() and not rows[0] else 0.0


def from_row(record: Record, row: int) -> Record:
    """`record` with only the rows from `row` on counted: the rows before let a model settle."""
    before = record.columns.get(RUN_IN, np.zeros(len(record)))
    return record.with_column(RUN_IN, np.maximum(before, np.arange(len(record)) < row))


def filled(record: Record, column: str) -> Record:
    """`record` with `column` straight between the rows that count."""
    return straight_over(record, column, ~used(record)) if USED in record.columns else record


def run_in(view: View) -> int:
    """How many rows at the start of a record do not count, because it starts in motion or under load; else 0."""
    if view.kind.stage or view.kind.vibrates or not view.moves.any():
        return 0
    if not (_starts_in_motion(view) or _starts_loaded(view)):
        return 0
    travelled = np.cumsum(np.abs(view.speed) * view.dt)
    return int(min(np.searchsorted(travelled, _settled_m(view)), round(SET.start_share * len(travelled))))


def _first(view: View, seconds: float = SET.start_s) -> slice:
    return slice(0, max(2, round(seconds / view.dt)))


def _starts_in_motion(view: View) -> bool:
    """Whether the record starts at half the usual speed or more; a pull, whose position has no noise, at any speed."""
    first, usual = _first(view), float(np.median(np.abs(view.speed[view.moves])))
    least = 0.0 if view.kind.drawn else 0.5 * usual
    return bool(view.moves[first].all()) and abs(float(np.mean(view.speed[first]))) >= least


def _starts_loaded(view: View) -> bool:
    """Whether the magnet's gap at the start is a large share of that in motion, measured from the mean of both
    directions where there are two, so that an offset is no load. The force of a pull shows no load: it keeps at rest
    the resistance that it had in motion.
    """
    if not view.kind.follows or not {"carriage_position_m", "position_m"} <= set(view.record.columns):
        return False
    load = view.record["carriage_position_m"] - view.record["position_m"]
    low, high = np.percentile(load[view.moves], [10, 90])
    forth = float(np.mean(view.speed[view.moves] > 0))
    middle, most = 0.0, max(abs(low), abs(high))
    if SET.both_ways < forth < 1 - SET.both_ways:
        middle, most = 0.5 * (low + high), 0.5 * (high - low)
    return bool(abs(float(np.mean(load[_first(view, SET.at_once_s)])) - middle) > SET.loaded * most > 0)


def check_start(view: View) -> Findings:
    """Whether the record starts in motion or under load; predictions start at rest and free."""
    if rows := run_in(view):
        case = "starts_in_motion" if _starts_in_motion(view) else "starts_in_motion.loaded"
        speed = float(np.mean(view.speed[_first(view)]))
        yield view.notes(case, view.moving_column, [0], speed=speed, skipped=rows * view.dt)
