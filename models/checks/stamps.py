"""Time stamps as they were logged: in another unit, repeated, uneven, missing, beginning again, with pauses."""

import numpy as np

from models.checks.finding import Findings
from models.checks.settings import SET
from models.checks.view import View, times
from models.records.record import USED
from models.rigs.columns import TIME


def check_interval(view: View) -> Findings:
    """The usual interval between stamps, and what they span, against what a record may have."""
    usual, span, (low, high) = float(np.median(np.abs(np.diff(view.t)))), float(np.ptp(view.t)), SET.step_s
    if usual and not low <= usual <= high:
        limit = f"at least {low:g}" if usual < low else f"at most {high:g}"
        said = f"t_s must step by {limit} s; got steps of {usual:g} s: is it in s?"
        yield view.stops("time_units", said, "interval between stamps", view.unit_line(TIME), TIME)
    elif span < SET.record_s:
        said = f"the record lasts {span:.3g} s ({len(view.t)} samples {view.dt:.3g} s apart): is t_s in s?"
        how, remedy = "time from the first stamp to the last", f"{view.unit_line(TIME)}, or longer records"
        yield view.weakens("time_units", said, how, remedy, TIME)


def check_sparse_values(view: View) -> Findings:
    """Cells of the measured column that the file leaves empty."""
    if USED in view.record.columns:
        there, rate = view.record[USED] > 0, 1 / view.dt
        yield view.notes(
            "sparse_values",
            f"{view.measured} has a value in {there.sum()} of {len(there)} rows: {rate * there.mean():.3g} a second,"
            f" where there are {rate:.4g} rows; it is compared in these",
            "empty cells",
            "leave them empty: a value that is filled in would count as measured",
        )


def check_restart(view: View) -> Findings:
    """Stamps that go back."""
    back = np.flatnonzero(np.diff(view.t) < 0) + 1
    if len(back) > SET.stamps_back * len(view.t):
        said = f"t_s falls from {view.t[0]:.6g} to {view.t[-1]:.6g} s: the rows stand in reverse order"
        how = "nearly every stamp is smaller than the one before"
        yield view.stops("stamps_reversed", said, how, "sort the rows by t_s", TIME)
    elif len(back):
        yield view.stops(
            "stamps_restart",
            f"t_s goes back {len(back)} times, first from {view.t[back[0] - 1]:.6g} to {view.t[back[0]]:.6g} s:"
            " the logger began again, or two logs stand in one file",
            "a stamp that is smaller than the one before",
            f"cut the file before line {view.record.line(int(back[0]))} into two records",
            TIME,
            back,
        )


def check_repeats(view: View) -> Findings:
    """Stamps that stand twice."""
    same = np.flatnonzero(np.diff(view.t) == 0) + 1
    if len(same):
        said = f"{len(same)} samples have the stamp of the one before: the clock is coarser than the sampling"
        how, remedy = "a stamp that is equal to the one before", "log with a finer clock, or keep one sample a stamp"
        yield view.stops("stamps_repeated", said, how, remedy, TIME, same)


def check_uneven(view: View) -> Findings:
    """Stamps that jitter, samples that are missing, and long gaps."""
    steps = np.diff(view.t) / view.dt
    usual = steps[(steps > SET.stamps_short) & (steps < 1.5)]
    jitter = float(np.std(usual)) if np.any(usual) else 0.0
    if jitter > SET.stamps_uneven:
        yield view.notes(
            "stamps_uneven",
            f"samples come {1 / view.dt:.4g} times a second, but unevenly by {100 * jitter:.0f} % of the interval;"
            " predictions are made at the stamps as they are",
            "standard deviation of the intervals between stamps",
            "stamp samples where they are taken, not where they are written",
            TIME,
        )
    lost = np.flatnonzero((steps > 1.5) & (steps <= SET.stamps_pause)) + 1
    if len(lost):
        count = int(np.sum(np.round(steps[lost - 1]) - 1))
        share = 100 * count / (count + len(view.t))
        said = f"{count} samples ({share:.2g} %) are missing; nothing is put in their place"
        how, remedy = (
            "intervals of more than one and a half times the usual one",
            "look at the logger's buffer and load",
        )
        yield view.finding("note" if share < 10 else "weakens", "stamps_missing", said, how, remedy, TIME, lost)
    gaps = np.flatnonzero(steps > SET.stamps_pause) + 1
    if len(gaps):
        longest = float(np.max(np.diff(view.t)[gaps - 1]))
        said = f"the record pauses {times(gaps)}, up to {longest:.3g} s; what moved meanwhile is not known"
        how = f"intervals of more than {SET.stamps_pause:g} times the usual one"
        remedy = f"cut the record at line {view.record.line(int(gaps[0]))}"
        yield view.weakens("pause", said, how, remedy, TIME, gaps)
