"""Time stamps as they were logged: in another unit, repeated, uneven, missing, beginning again, with pauses."""

import numpy as np

from models.checks.finding import Findings
from models.checks.settings import SET
from models.checks.view import View
from models.records.record import USED
from models.rigs.columns import TIME


def check_interval(view: View) -> Findings:
    """The usual interval between stamps, and what they span, against what a record may have."""
    usual, span, (low, high) = float(np.median(np.abs(np.diff(view.t)))), float(np.ptp(view.t)), SET.step_s
    line = view.unit_line(TIME)
    if usual and not low <= usual <= high:
        yield view.stops("time_units.interval", TIME, step=usual, low=low, high=high, line=line)
    elif span < SET.record_s:
        yield view.weakens("time_units.short", TIME, span=span, n=len(view.t), step=view.dt, line=line)


def check_sparse_values(view: View) -> Findings:
    """Cells of the measured column that the file leaves empty."""
    if USED in view.record.columns:
        there = view.record[USED] > 0
        rate = float(there.mean()) / view.dt
        yield view.notes("sparse_values", n=int(there.sum()), total=len(there), rate=rate)


def check_restart(view: View) -> Findings:
    """Stamps that go back."""
    back = np.flatnonzero(np.diff(view.t) < 0) + 1
    if len(back) > SET.stamps_back * len(view.t):
        yield view.stops("stamps_reversed", TIME, first=view.t[0], last=view.t[-1])
    elif len(back):
        first = int(back[0])
        before, after, line = view.t[first - 1], view.t[first], view.record.line(first)
        yield view.stops("stamps_restart", TIME, back, n=len(back), before=before, after=after, line=line)


def check_repeats(view: View) -> Findings:
    """Stamps that stand twice."""
    same = np.flatnonzero(np.diff(view.t) == 0) + 1
    if len(same):
        yield view.stops("stamps_repeated", TIME, same, n=len(same))


def check_uneven(view: View) -> Findings:
    """Stamps that jitter, samples that are missing, and long gaps."""
    steps = np.diff(view.t) / view.dt
    usual = steps[(steps > SET.stamps_short) & (steps < 1.5)]
    jitter = float(np.std(usual)) if np.any(usual) else 0.0
    if jitter > SET.stamps_uneven:
        yield view.notes("stamps_uneven", TIME, jitter=jitter, step=view.dt)
    lost = np.flatnonzero((steps > 1.5) & (steps <= SET.stamps_pause)) + 1
    if len(lost):
        count = int(np.sum(np.round(steps[lost - 1]) - 1))
        share = count / (count + len(view.t))
        yield view.finding("note" if share < 0.1 else "weakens", "stamps_missing", TIME, lost, n=count, share=share)
    gaps = np.flatnonzero(steps > SET.stamps_pause) + 1
    if len(gaps):
        longest, line = float(np.max(np.diff(view.t)[gaps - 1])), view.record.line(int(gaps[0]))
        yield view.weakens("pause", TIME, gaps, n=len(gaps), longest=longest, limit=SET.stamps_pause, line=line)
