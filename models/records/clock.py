"""Columns with clocks of their own on one: what is missing stays missing, what is left out is told with its place."""

from bisect import bisect_left
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from models.rigs.columns import TIME
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Samples = Mapping[str, tuple[Array, Array]]
"""Times and values of each column."""
ASTRAY: Final = 0.01  # largest share of stamps out of order that are single wrong ones
_RESTARTS: Final = 8  # most times that a clock may begin again; more is no order at all
_BRIDGED: Final = 5.0  # usual intervals between samples that may be joined by a straight line
_USUAL: Final = 0.95  # share of the intervals that are no longer than the usual one: samples may come in bursts
_SPREAD: Final = 2.0  # times the median that most differences of stamps are, at most, at an even rate
_OFTEN: Final = 0.25  # share of stamps of a log that fall, from which they are differences
_LEVEL: Final = 0.1  # share of their span by which such stamps rise from one half to the other, at most
_MOST_PARTS: Final = 100  # rows that are added within an interval of a switch


class ClockError(ValueError):
    """Clocks that no record can have, in one sentence."""


@dataclass(frozen=True)
class LeftOut:
    """Samples of a `column` that a reading leaves out or restores: `why` is the name of the finding that tells it, with
    what `share` of all they are, `where` the first ones stand and a `sentence`.
    """

    why: str
    column: str
    share: float
    where: str
    sentence: str


def left_out(case: str, column: str, times: Array, total: int, places: Sequence[str] = (), **values: Any) -> LeftOut:
    """What is said of `total` samples of `column` of which those at the `times`, or at these `places`, are left out."""
    at = ["no stamp" if np.isnan(t) else f"{t:.6g} s" for t in times[:3]]
    at = [f"{place} ({time})" for place, time in zip(places, at, strict=False)] or at
    shown = ", ".join(at) + (f" and {len(times) - 3} more" if len(times) > 3 else "")
    sentence = TEXT(f"lost.{case}", column=column, n=len(times), total=total, where=shown, **values)
    return LeftOut(case, column, len(times) / total, shown or "throughout", sentence)


def in_order(times: Array) -> tuple[Mask, list[int]]:
    """Which stamps are kept, so that the fewest are left out where the others rise; and the rows from which the clock
    begins again. Stamps in no order at all are kept as they are.
    """
    kept = np.isfinite(times)
    if (np.diff(times[kept]) > 0).all():
        return kept, []
    rows = np.flatnonzero(kept)
    rising = rows[_longest_rise(times[rows].tolist())]
    if len(rows) - len(rising) <= max(1, ASTRAY * len(rows)):
        kept[:] = False
        kept[rising] = True
        return kept, []
    back = rows[1:][np.diff(times[rows]) < 0]
    return kept, back.tolist() if len(back) <= _RESTARTS else []


def _longest_rise(values: Sequence[float]) -> list[int]:
    """Places of a longest strictly rising choice of `values`, in their order."""
    ends, places, before = list[float](), list[int](), list[int]()
    for k, value in enumerate(values):
        at = bisect_left(ends, value)
        before.append(places[at - 1] if at else -1)
        if at == len(ends):
            ends.append(value)
            places.append(k)
        else:
            ends[at], places[at] = value, k
    chosen, k = list[int](), places[-1] if places else -1
    while k >= 0:
        chosen.append(k)
        k = before[k]
    return chosen[::-1]


def are_differences(times: Array, even: bool = True) -> bool:
    """Whether stamps are times since the one before: none negative, many falling; at an `even` rate all of one size."""
    back = np.diff(times) < 0
    if len(times) < 3 or not np.isfinite(times).all() or times.min() < 0 or not times.any():
        return False
    if not even:
        first, then = (float(np.mean(half)) for half in np.array_split(times, 2))
        return bool(back.mean() > _OFTEN and abs(then - first) < _LEVEL * np.ptp(times))
    low, usual, high = np.percentile(times[1:], [5, 50, 95])
    one_size = usual > 0 and low * _SPREAD >= usual and high <= _SPREAD * usual
    return bool(one_size and (back.mean() > ASTRAY or np.ptp(times[1:]) == 0))


def usual_step(times: Array) -> float:
    """The usual interval between rising times."""
    return float(np.quantile(np.diff(times), _USUAL)) if len(times) > 1 else 0.0


def in_gaps(at: Array, times: Array, least: float = 0.0) -> Mask:
    """Which times `at` lie beyond `times` or where these are further apart than a few steps, and than `least`."""
    after = np.searchsorted(times, at, side="left")
    low, high = times[np.maximum(after - 1, 0)], times[np.minimum(after, len(times) - 1)]
    apart = (high != at) & (high - low > max(_BRIDGED * usual_step(times), least))
    return np.asarray(apart | (at < times[0]) | (at > times[-1]))


def mean_before(rows: Array, times: Array, levels: Array) -> Array:
    """Mean of the piecewise constant `levels` since the previous row; the first interval is as long as the second."""
    area = np.concatenate([[0.0], np.cumsum(levels[:-1] * np.diff(times))])
    last = np.array([rows[0] - (rows[1] - rows[0]), *rows[:-1]]) if len(rows) > 1 else rows - 1e-3
    upto = np.interp(rows, times, area) + np.maximum(rows - times[-1], 0.0) * levels[-1]
    before = np.interp(last, times, area) + np.maximum(last - times[-1], 0.0) * levels[-1]
    return np.asarray((upto - before) / (rows - last))


def _with_changes(rows: Array, times: Array) -> Array:
    """The times `rows` with further ones evenly between, as close as the changes at `times` of a level are."""
    if len(rows) < 2 or len(times) < 2:
        return rows
    parts = np.clip(np.round(np.diff(rows) / float(np.median(np.diff(times)))), 1, _MOST_PARTS).astype(int)
    at = np.concatenate([[0], np.cumsum(parts)])
    return np.interp(np.arange(at[-1] + 1), at, rows)


def _with_gaps(rows: Array, others: Sequence[Array]) -> Array:
    """The times `rows` and, in their gaps, those at which another column has samples, as far apart as rows are."""
    step = usual_step(rows)
    more = np.unique(np.concatenate([times[in_gaps(times, rows)] for times in others]))
    more = more[(more > rows[0]) & (more < rows[-1])]
    after = rows[np.searchsorted(rows, more) - 1]
    places = np.floor((more - after) / step + 1e-6)  # one a step of the rows
    first = np.diff(places, prepend=0.0) != 0
    return np.union1d(rows, more[first & (places > 0)])


def one_clock(
    samples: Samples, rows_of: str, held: Collection[str] = ()
) -> tuple[dict[str, Array], tuple[str, ...], tuple[LeftOut, ...]]:
    """Columns at the times of `rows_of`, with `t_s`; notes on the resampling; what was left out.

    Others are straight between samples that are no further apart than a few of their usual intervals; a row without
    that is left out, and so are rows beyond the time that all share. Gaps of `rows_of` have rows at the others' times,
    with NaN. A `held` column is the mean of its levels since the previous row, with further rows if it changes
    more often. Single stamps out of order are left out; where all clocks begin again together, so does `t_s`. Raises
    ClockError.
    """
    cuts = {name: in_order(times)[1] for name, (times, _) in samples.items()}
    if any(cuts.values()):
        return _in_pieces(samples, cuts, rows_of, held)
    lost, clean = list[LeftOut](), dict[str, tuple[Array, Array]]()
    for name, (times, values) in samples.items():
        kept, numbers = in_order(times)[0], np.isfinite(values)
        if not numbers.all():
            lost.append(left_out("no_number", name, times[~numbers], len(times)))
        if not kept.all():
            lost.append(left_out("stamps_astray", name, times[~kept], len(times)))
        if not (kept & numbers).any():
            raise ClockError(TEXT("clock.no_samples", column=name))
        order = np.argsort(times[kept & numbers], kind="stable")
        clean[name] = times[kept & numbers][order], values[kept & numbers][order]
    own = clean[rows_of][0]
    smooth = {name: times for name, (times, _) in clean.items() if name not in held and name != rows_of}
    start, end = (pick(times[k] for times, _ in clean.values()) for pick, k in ((max, 0), (min, -1)))
    if start > end:
        spans = [f"{name} {times[0]:.6g} to {times[-1]:.6g} s" for name, (times, _) in clean.items()]
        raise ClockError(TEXT("clock.apart", spans=spans))
    rows = _with_gaps(own, list(smooth.values())) if smooth and len(own) > 1 else own
    inside = (rows >= start) & (rows <= end)
    if not inside.all():
        lost.append(left_out("outside", rows_of, rows[~inside], len(rows), start=float(start), end=float(end)))
    for name, times in smooth.items():
        gone = inside & in_gaps(rows, times, usual_step(own))
        if gone.any():
            longest = float(np.max(np.diff(times)))
            lost.append(left_out("gap", name, rows[gone], len(rows), longest=longest))
        inside &= ~gone
    levels = next((clean[name][0] for name in samples if name in held and name != rows_of), own[:0])
    at, notes = _with_changes(rows[inside], levels), list[str]()
    columns = {TIME: at, rows_of: np.full(len(at), np.nan)}
    place = np.minimum(np.searchsorted(own, at), len(own) - 1)
    there = own[place] == at
    columns[rows_of][there] = clean[rows_of][1][place[there]]
    for name, (times, values) in clean.items():
        if name == rows_of:
            continue
        averaged = name in held
        columns[name] = (
            (mean_before(at, times, values) if len(at) else at) if averaged else np.interp(at, times, values)
        )
        case = "averaged" if averaged else "interpolated"
        notes.append(TEXT(f"clock.{case}", column=name, n=len(times), rows_of=rows_of))
    return {name: columns[name] for name in (TIME, *samples)}, tuple(notes), tuple(lost)


def _in_pieces(
    samples: Samples, cuts: Mapping[str, list[int]], rows_of: str, held: Collection[str]
) -> tuple[dict[str, Array], tuple[str, ...], tuple[LeftOut, ...]]:
    """The columns of one file after another, where the clocks of all begin again as often."""
    if len({len(rows) for rows in cuts.values()}) > 1:
        name, rows = next((name, rows) for name, rows in cuts.items() if rows)
        times = samples[name][0]
        raise ClockError(
            TEXT("clock.restart", column=name, before=times[rows[0] - 1], after=times[rows[0]], row=rows[0])
        )
    parts = {
        name: list(zip(np.split(times, cuts[name]), np.split(values, cuts[name]), strict=True))
        for name, (times, values) in samples.items()
    }
    count = len(cuts[rows_of]) + 1
    made = [one_clock({name: pieces[k] for name, pieces in parts.items()}, rows_of, held) for k in range(count)]
    columns = {name: np.concatenate([piece[name] for piece, _, _ in made]) for name in made[0][0]}
    return columns, made[0][1], tuple(one for _, _, lost in made for one in lost)
