"""Time stamps: uneven, missing, repeated, beginning again, with pauses."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import View


def check_restart(view: View) -> list[RecordFinding]:
    """Stamps that go back."""
    if not view.timed:
        return []
    back = np.flatnonzero(np.diff(view.t) < 0) + 1
    if not len(back):
        return []
    if len(back) > SET.stamps_back * len(view.t):
        said = f"t_s falls from {view.t[0]:.6g} to {view.t[-1]:.6g} s: the rows stand in reverse order"
        how, remedy = "nearly every stamp is smaller than the one before", "sort the rows by t_s"
        return [view.finding("stamps_reversed", "stops", "t_s, throughout", said, how, remedy)]
    return [
        view.finding(
            "stamps_restart",
            "stops",
            f"t_s, {view.at(back)}",
            f"t_s goes back {len(back)} times, first from {view.t[back[0] - 1]:.6g} to {view.t[back[0]]:.6g} s:"
            " the logger began again, or two logs stand in one file",
            "a stamp that is smaller than the one before",
            f"cut the file before line {view.record.line(int(back[0]))} into two records",
        )
    ]


def check_repeats(view: View) -> list[RecordFinding]:
    """Stamps that stand twice."""
    if not view.timed:
        return []
    same = np.flatnonzero(np.diff(view.t) == 0) + 1
    if not len(same):
        return []
    return [
        view.finding(
            "stamps_repeated",
            "stops",
            f"t_s, {view.at(same)}",
            f"{len(same)} samples have the stamp of the one before: the clock is coarser than the sampling",
            "a stamp that is equal to the one before",
            "log with a finer clock, or keep one sample a stamp",
        )
    ]


def check_uneven(view: View) -> list[RecordFinding]:
    """Stamps that jitter, and samples that are missing."""
    if not view.timed:
        return []
    steps = np.diff(view.t)
    steps = steps[steps > 0] / view.dt
    if not len(steps):
        return []
    found = []
    lost = np.flatnonzero((np.diff(view.t) / view.dt > 1.5) & (np.diff(view.t) / view.dt <= SET.stamps_pause)) + 1
    jitter = float(np.std(usual)) if np.any(usual := steps[(steps > SET.stamps_short) & (steps < 1.5)]) else 0.0
    if jitter > SET.stamps_uneven:
        found.append(
            view.finding(
                "stamps_uneven",
                "note",
                "t_s, throughout",
                f"samples come {1 / view.dt:.4g} times a second, but unevenly by {100 * jitter:.0f} % of the interval;"
                " predictions are made at the stamps as they are",
                "standard deviation of the intervals between stamps",
                "stamp samples where they are taken, not where they are written",
            )
        )
    if len(lost):
        count = int(np.sum(np.round(np.diff(view.t)[lost - 1] / view.dt) - 1))
        share = 100 * count / (count + len(view.t))
        found.append(
            view.finding(
                "stamps_missing",
                "note" if share < 10 else "weakens",
                f"t_s, {view.at(lost)}",
                f"{count} samples ({share:.2g} %) are missing; nothing is put in their place",
                "intervals of more than one and a half times the usual one",
                "look at the logger's buffer and load",
            )
        )
    return found


def check_pauses(view: View) -> list[RecordFinding]:
    """Long gaps."""
    if not view.timed:
        return []
    gaps = np.flatnonzero(np.diff(view.t) / view.dt > SET.stamps_pause) + 1
    if not len(gaps):
        return []
    longest = float(np.max(np.diff(view.t)[gaps - 1]))
    return [
        view.finding(
            "pause",
            "weakens",
            f"t_s, {view.at(gaps)}",
            f"the record pauses {'once' if len(gaps) == 1 else f'{len(gaps)} times'}, up to {longest:.3g} s; what moved"
            " meanwhile is not known",
            f"intervals of more than {SET.stamps_pause:g} times the usual one",
            f"cut the record at line {view.record.line(int(gaps[0]))}",
        )
    ]
