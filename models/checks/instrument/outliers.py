"""Single samples far off both neighbours, and values that are none: -999 of a logger that got no answer."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.instrument.clipping import clipped
from models.checks.settings import SET
from models.checks.view import Array, Mask, View
from models.records.record import Record
from models.rigs.columns import TIME

SWITCHED = ("drive_on", "coil_voltage_V")
"""Driven columns with edges of their own."""


def spikes(view: View, values: Array) -> Mask:
    """Where one or two samples of `values` stand off both sides by far more than noise and motion do, and by more than
    the two sides differ: after an outlier the signal is where it was, after a step or a pulse it is not; shape (n,).
    """
    mask = np.zeros(len(values), dtype=bool)
    if not view.timed or len(values) < 50:
        return mask
    for width in (1, 2):
        left, right = values[width:-width] - values[: -2 * width], values[width:-width] - values[2 * width :]
        off = np.minimum(np.abs(left), np.abs(right)) - np.abs(left - right)
        score = np.where(left * right > 0, np.maximum(off, 0.0), 0.0)
        second = np.abs(np.diff(values, 2))
        noise = float(np.median(second)) / 0.6745 / np.sqrt(6)
        span = float(np.diff(np.percentile(values, [1, 99]))[0])
        limit = max(SET.far * noise, SET.outlying * float(np.percentile(score, 95)), SET.visible * span)
        found = np.flatnonzero(score > limit) + width
        if len(found) <= SET.outlier_most * len(values):
            mask[found] = True
    return mask


def beyond(values: Array) -> Mask:
    """Where `values` lie ten times as far from their median as all the others do, shape (n,): at most a twentieth of
    them.
    """
    far = np.abs(values - np.median(values))
    ranked = np.sort(far)
    last = ranked[-1 - round(SET.stray_most * len(far)) :]
    gaps = np.flatnonzero((last[1:] > SET.stray_apart * last[:-1]) & (last[:-1] > 0))
    return np.asarray(far > last[gaps[0]] if len(gaps) else np.zeros(len(far), dtype=bool))


def off(view: View) -> Mask:
    """Where the measured column holds an outlier of either kind."""
    return spikes(view, view.y) | beyond(view.y) if view.timed else np.zeros(len(view.y), dtype=bool)


def without_outliers(view: View) -> Record:
    """The record with outliers of its measured and its driven column straight between their neighbours."""
    record = view.record
    if not view.timed or view.measured not in record.columns:
        return record
    outliers = {view.measured: off(view)}
    if view.driven and view.driven not in SWITCHED:
        outliers[view.driven] = spikes(view, record[view.driven])
    for name, far in outliers.items():
        record = straight_over(record, name, far)
    return record


def straight_over(record: Record, name: str, gaps: Mask) -> Record:
    """The record with its column `name` straight between the neighbours of `gaps`, shape (n,)."""
    if not gaps.any():
        return record
    t = record[TIME]
    return record.with_column(name, np.interp(t, t[~gaps], record[name][~gaps]))


def check_no_values(view: View) -> list[RecordFinding]:
    """Values of the measured column that no sensor gave."""
    where = beyond(view.y) if view.timed else np.zeros(0, dtype=bool)
    if not where.any():
        return []
    shown = ", ".join(f"{value:.6g}" for value in np.unique(view.y[where])[:3])
    return [
        view.finding(
            "no_values",
            "note",
            f"{view.measured}, {view.at(np.flatnonzero(where))}",
            f"{int(where.sum())} samples of {view.measured} are {shown}, far from all others: a logger's sign for no"
            " value; they are left out of every fit",
            f"{SET.stray_apart:g} times as far from the median as every other sample",
            "leave such rows out of the file",
        )
    ]


def check_outliers(view: View) -> list[RecordFinding]:
    """Outliers of the measured and of the driven columns."""
    found = []
    for name in dict.fromkeys(n for n in (view.measured, view.driven) if n and n in view.record.columns):
        if name in SWITCHED:
            continue
        where = spikes(view, view.record[name]) & ~clipped(view)
        if name == view.measured:
            where &= ~beyond(view.y)
        if where.any():
            found.append(
                view.finding(
                    "outliers",
                    "note",
                    f"{name}, {view.at(np.flatnonzero(where))}",
                    f"{int(where.sum())} samples of {name} stand far off their neighbours on both sides; they are left"
                    " out of every fit",
                    f"more than {SET.far:g} standard deviations of the noise off both neighbours",
                    "look at cable, connector and interference; delete the samples if they are none of the rig's",
                )
            )
    return found
