"""Which samples of a measured column a fit may use, and the record with the others filled in."""

import numpy as np

from models.checks.information.start import run_in
from models.checks.instrument.clipping import clipped
from models.checks.instrument.held_values import fresh
from models.checks.instrument.outliers import SWITCHED, off, spikes, straight_over
from models.checks.instrument.resolution import PLACES, without_steps
from models.checks.instrument.silence import silent
from models.checks.settings import SET
from models.checks.view import Mask, View, runs_of
from models.records.record import USED, Record, where_measured
from models.rigs.columns import TIME
from models.rigs.rig import Rig

RUN_IN = "_run_in"
"""Column of a record that is judged from some row on: 1 in what comes before, which is only run through."""


def usable(view: View) -> Mask:
    """Where the measured column holds a value of its own: new, not clipped, no outlier, not filled in."""
    return np.asarray(fresh(view) & ~clipped(view) & ~off(view) & ~silent(view))


def cleaned(record: Record, rig: Rig) -> Record:
    """`record` with what cannot be used of its measured and driven columns straight between neighbours, and columns
    that say which measured values count and which are run through only; itself where all can be used.
    """
    view = View(record, rig)
    if not view.timed or view.measured not in record.columns:
        return record
    good = used(record)
    good[good] = usable(View(where_measured(record), rig))
    if not good.all() and good.sum() > 2:
        record = filled(record.with_column(USED, good), view.measured)
    rows = run_in(view)
    if rows:
        record = from_row(record, rows)
    if view.driven and view.driven not in SWITCHED:
        record = straight_over(record, view.driven, spikes(view, view.record[view.driven]))
    if view.driven in PLACES:
        record = record.with_column(view.driven, without_steps(view, record[view.driven]))
    return record


def used(record: Record) -> Mask:
    """The rows of a record whose measured value counts; all of one that was not cleaned."""
    return record[USED] > SET.usable_whole if USED in record.columns else np.ones(len(record), dtype=bool)


def gone(record: Record) -> Mask:
    """The rows of a record over which the sensor says nothing for longer than it usually takes to say something: where
    an observer has to run free.
    """
    good = used(record)
    if good.all() or not good.any():
        return ~good
    usual = float(np.median(np.diff(np.flatnonzero(good)))) if good.sum() > 1 else 1.0
    least = max(SET.gone_s / max(float(np.median(np.diff(record[TIME]))), 1e-12), SET.gone_intervals * usual)
    mask = np.zeros(len(record), dtype=bool)
    for a, b in runs_of(~good):
        mask[a:b] = b - a >= least
    return mask


def counted(record: Record) -> Mask:
    """The rows of a record whose residuals count: used, and no run-in."""
    return used(record) & (record[RUN_IN] < SET.usable_whole) if RUN_IN in record.columns else used(record)


def lead_in_s(record: Record) -> float:
    """How long in s a record is run through before its residuals count."""
    rows = counted(record)
    return float(record[TIME][np.argmax(rows)] - record[TIME][0]) if rows.any() and not rows[0] else 0.0


def from_row(record: Record, row: int) -> Record:
    """`record`, of which only the rows from `row` on count: what a model needs in order to know its state there."""
    before = record.columns.get(RUN_IN, np.zeros(len(record)))
    return record.with_column(RUN_IN, np.maximum(before, np.arange(len(record)) < row))


def filled(record: Record, column: str) -> Record:
    """`record` with `column` straight between the rows that count."""
    if USED not in record.columns:
        return record
    return straight_over(record, column, ~used(record))
