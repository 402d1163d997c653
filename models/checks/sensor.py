"""Single values that a sensor or its amplifier spoiled: clipped, repeated, lost, replaced, off.

A mask says which samples of the measured column a fit may not use; a check reports them.
"""

import numpy as np

from models.checks.estimators import Mask, grid_step, runs_of, white_noise
from models.checks.finding import Findings, Severity
from models.checks.settings import SET
from models.checks.view import View, once
from models.records.record import Record
from models.rigs.columns import TIME
from models.words.quantities import number

SWITCHED = ("drive_on", "coil_voltage_V")
"""Driven columns with edges of their own."""


@once
def clipped(view: View) -> Mask:
    """Where the measured column stands at an end of its range as clipping leaves it, (n,); nowhere without noise."""
    y, mask, step, span = view.y, np.zeros(len(view.y), dtype=bool), grid_step(view.y), float(np.ptp(view.y))
    if span == 0 or view.noise <= max(SET.clip_dither * step, 1e-7 * span):
        return mask
    for end in (float(y.max()), float(y.min())):
        at = np.abs(y - end) <= max(0.5 * step, 1e-9 * span)
        runs, rest = np.array([b - a for a, b in runs_of(at)]), y[~at]
        usual = len(rest) / max(1, int(np.sum(np.diff(rest) != 0)) + 1)
        long = np.sum(runs >= SET.clip_run) >= SET.clips and runs.mean() > SET.clip_long * usual / 2
        mask |= at & bool(long and at.mean() > SET.clip_share)
    return mask


def check_clipping(view: View) -> Findings:
    """Clipping or saturation of the measured column."""
    where = clipped(view)
    if where.any():
        values = view.y[where]
        limits = [view.of_measured(end) for end in np.unique([values.min(), values.max()])]
        yield view.weakens("clipping", rows=np.flatnonzero(where), share=where.mean(), limits=limits)


@once
def fresh(view: View) -> Mask:
    """Where a value of the measured column is a new one, shape of the column; everywhere where none are repeated."""
    y, mask = view.y, np.ones(len(view.y), dtype=bool)
    changes = np.flatnonzero(np.concatenate([[True], np.diff(y) != 0]))
    if len(y) < 20 or len(changes) > (1 - SET.held_share) * len(y) or len(changes) < 10:
        return mask
    # the next step of a coarse scale is no new value
    coarse = np.median(np.abs(np.diff(y[changes]))) < 1.5 * grid_step(y)
    lengths = np.diff(changes)
    usual = float(np.median(lengths))
    regular = np.mean(np.abs(lengths - usual) <= max(1.0, 0.1 * usual)) >= SET.held_regular
    if coarse or usual < 2 or not regular:
        return mask
    mask[:] = False
    mask[changes] = True
    long = lengths > SET.held_again * usual  # the same value measured again
    for first, length in zip(changes[:-1][long], lengths[long], strict=True):
        mask[np.round(np.arange(first, first + length - 0.5 * usual, usual)).astype(int)] = True
    return mask


def check_held_values(view: View) -> Findings:
    """A measured column of a slow sensor that is logged at a faster rate."""
    share = float(fresh(view).mean())
    if share < 1 and clipped(view).mean() <= SET.held_clipped:
        yield view.notes("held_values", rate=1 / view.dt, fresh=share / view.dt, length=1 / share)


@once
def silent(view: View) -> Mask:
    """Where the measured column lies on one value or one straight line for longer than its noise lets it; nowhere in a
    column without noise. Shape of the column. Of a column that changes with every sample one exact value suffices,
    however fast the motion, but for a rest at either end.
    """
    mask, second = _held(view), np.diff(view.y, 2)
    if mask.any():
        return mask & ~clipped(view)
    usual = float(np.median(np.abs(second)))
    still = np.abs(second) <= SET.silent * usual
    runs = runs_of(still, max(SET.silence_samples, round(SET.silence_s / view.dt)))
    if len(mask) < 10 * SET.silence_samples or usual == 0 or not runs:
        return mask
    for a, b in runs:
        mask[a : b + 2] = True
    rest = ~mask[1:-1]
    pairs = rest[1:] & rest[:-1] & (np.maximum(np.abs(second[1:]), np.abs(second[:-1])) < 5 * usual)
    power = float(np.sum(second[:-1][pairs] ** 2))
    share = float(np.mean(still[rest])) if rest.any() else 1.0
    noisy = power > 0 and float(second[1:][pairs] @ second[:-1][pairs]) < SET.silence_noisy * power
    chance = len(mask) * share**SET.silence_samples > SET.silence_chance
    return mask & ~clipped(view) & (noisy and not chance)


def _held(view: View) -> Mask:
    mask, same = np.zeros(len(view.y), dtype=bool), np.diff(view.y) == 0
    runs = runs_of(same, max(SET.silence_samples, round(SET.silence_s / view.dt)))
    for a, b in runs:
        mask[a : b + 1] = True
    inside = [(a, b) for a, b in runs if a > 0 and b < len(same)]
    if len(inside) < len(runs) or np.mean(same[~mask[1:]]) > SET.silence_repeats:
        mask[:] = False
    return mask


def check_silence(view: View) -> Findings:
    """Stretches in which a noisy sensor has no noise: its signal was lost and then held or filled in."""
    mask = silent(view)
    if mask.any():
        lost = runs_of(mask)
        longest, least = max((b - a) * view.dt for a, b in lost), SET.silence_samples
        begins = [a for a, _ in lost]
        much, n = mask.mean() > SET.silence_much, len(lost)
        severity: Severity = "weakens" if much else "note"
        yield view.finding(severity, "sensor_silent", rows=begins, n=n, longest=longest, least=least)


@once
def spikes(view: View, name: str) -> Mask:
    """Where one or two samples of the column `name` differ from both sides by far more than noise and motion do, and by
    more than the sides differ from each other, shape (n,): an outlier, no step and no pulse.
    """
    values = view.record[name]
    mask = np.zeros(len(values), dtype=bool)
    if len(values) < 50 or name in SWITCHED:
        return mask
    span = float(np.diff(np.percentile(values, [1, 99]))[0])
    for width in (1, 2):
        left, right = values[width:-width] - values[: -2 * width], values[width:-width] - values[2 * width :]
        off = np.minimum(np.abs(left), np.abs(right)) - np.abs(left - right)
        score = np.where(left * right > 0, np.maximum(off, 0.0), 0.0)
        beside = SET.outlying * float(np.percentile(score, 95))
        bend = SET.outlying_bend * float(np.percentile(np.abs(left + right), 95)) / 2
        steps = SET.outlying_steps * grid_step(values)
        least = max(SET.far * white_noise(values), beside, bend, SET.visible * span, steps)
        found = np.flatnonzero(score > least) + width
        if len(found) <= SET.outlier_most * len(values):
            mask[found] = True
    return mask


@once
def beyond(view: View) -> Mask:
    """The measured values, shape (n,), ten times as far from the median as all others: at most a twentieth of them."""
    far = np.abs(view.y - np.median(view.y))
    last = np.sort(far)[-1 - round(SET.stray_most * len(far)) :]
    gaps = np.flatnonzero((last[1:] > SET.stray_apart * last[:-1]) & (last[:-1] > 0))
    return np.asarray(far > (last[gaps[0]] if len(gaps) else np.inf))


def off(view: View) -> Mask:
    """Where the measured column holds an outlier of either kind."""
    return spikes(view, view.measured) | beyond(view)


def without_outliers(view: View) -> Record:
    """The record with outliers of its measured and its driven column straight between their neighbours."""
    record = straight_over(view.record, view.measured, off(view))
    return straight_over(record, view.driven, spikes(view, view.driven)) if view.driven else record


def straight_over(record: Record, name: str, gaps: Mask) -> Record:
    """The record with its column `name` straight between the neighbours of `gaps`, shape (n,)."""
    if not gaps.any():
        return record
    t = record[TIME]
    return record.with_column(name, np.interp(t, t[~gaps], record[name][~gaps]))


def check_no_values(view: View) -> Findings:
    """Values of the measured column that no sensor gave: -999 of a logger that got no answer."""
    where = beyond(view)
    if where.any():
        values = [number(value, 6) for value in np.unique(view.y[where])[:3]]
        rows = np.flatnonzero(where)
        yield view.notes("no_values", rows=rows, n=len(rows), values=values, apart=SET.stray_apart)


def check_outliers(view: View) -> Findings:
    """Outliers of the measured and of the driven columns."""
    for name in dict.fromkeys((view.measured, view.driven or view.measured)):
        where = spikes(view, name) & ~clipped(view)
        if name == view.measured:
            where &= ~beyond(view)
        if where.any():
            yield view.notes("outliers", name, np.flatnonzero(where), n=int(where.sum()), far=SET.far)
