"""A series as if it had been logged slower and more seldom: what a fit does not need is left out, and told."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from models.identification.settings import SET
from models.records.record import USED, Record
from models.rigs.columns import TIME
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


def thinned(records: Sequence[Record], most: float = SET.most_rows) -> tuple[list[Record], list[Record]]:
    """Those of the `records` that show most, `most_records` with about `most` rows in all, and the others as slow.

    Of each k rows the last is kept; where few rows have a measured value, the last that has one. A record keeps at
    least `least_hz`, and 50 samples in the fastest period of its drive. No more records are kept than have thrice
    `most` rows at those rates.
    """
    few = len(records)
    if all(record.layout.time for record in records):
        left = sum(len(record) / longest_step(record) for record in records) if few > SET.fewest_records else 0
        few = min(few, SET.most_records, max(SET.fewest_records, math.floor(few * SET.too_many * most / max(left, 1))))
    best = range(few) if few == len(records) else showing(records, few)
    others = [record for k, record in enumerate(records) if k not in best]
    return slower([records[k] for k in best], most), slower(others, most * max(len(others), 1) / max(few, 1))


def said_of(records: Sequence[Record], kept: Sequence[Record], budget: bool) -> str:
    """What was left out of the `records` where these are `kept`, for a `budget` or not, in words; "" if nothing."""
    rows, left = sum(map(len, records)), sum(map(len, kept))
    fewer = f" {TEXT('fewer', records=len(records), chosen=len(kept))}" if len(kept) < len(records) else ""
    return TEXT("cut" if budget else "thinned", rows=rows, kept=left) + fewer if left < rows else ""


def showing(records: Sequence[Record], count: int) -> list[int]:
    """Which `count` of the time series show most, in order: chosen one after the other by what each adds to the
    logarithm of the time spent in each part of the range of each signal, of its rate and of the time from the start.
    """
    seen = [signals_of(record) for record in records]
    names = sorted(set[str]().union(*seen))
    spent = np.zeros((len(records), len(names), SET.showing_bins))
    for n, name in enumerate(names):
        low, high = np.percentile(np.concatenate([own[name] for own in seen if name in own]), SET.showing_ends)
        for k, own in enumerate(seen):
            spent[k, n], _ = np.histogram(np.clip(own.get(name, []), low, high), SET.showing_bins, (low, high))
    spent /= spent.mean()
    best, total = list[int](), np.zeros(spent.shape[1:])
    for _ in range(count):
        gains = np.log1p(total + spent).sum(axis=(1, 2))
        gains[best] = -np.inf
        best.append(int(np.argmax(gains)))
        total += spent[best[-1]]
    return sorted(best)


def signals_of(record: Record) -> dict[str, np.ndarray]:
    """Means of the columns over 0.1 s, their rates, and the time from the start."""
    t = record[TIME] - record[TIME][0]
    some = min(max(1, round(SET.showing_s * len(t) / max(float(t[-1]), 1e-9))), len(t) // 2)
    finite = {name: y for name, y in {**record.columns, TIME: t}.items() if name[0] != "_" and np.isfinite(y).all()}
    means = {name: y[: len(y) // some * some].reshape(-1, some).mean(axis=1) for name, y in finite.items()}
    return means | {f"{name} rate": np.diff(y) for name, y in means.items() if name != TIME}


def slower(records: Sequence[Record], most: float = SET.most_rows) -> list[Record]:
    """All of the `records`, with so few rows at most that their rates allow, of many at the usual rate."""
    rows = sum(map(len, records))
    wanted, usual = math.ceil(rows / most), rows / (SET.usual_share * most)

    def step(record: Record) -> int:
        fast = math.floor(min(usual, 1 / (SET.usual_hz * _interval(record))))
        return int(min(max(wanted, fast), longest_step(record)))

    return [_slower(r, step(r)) if wanted > 1 and r.layout.time else r for r in records]


def _interval(record: Record) -> float:
    return float(np.ptp(record[TIME])) / max(len(record) - 1, 1)


def longest_step(record: Record) -> int:
    """Of how many rows one may be kept; all beside an accelerometer, whose readings are means over their intervals."""
    if not record.columns.keys().isdisjoint(record.layout.beside):
        return 1
    dt = _interval(record)
    driven = [name for names in record.layout.driven for name in names if name in record.columns]
    fastest = max((_fastest_Hz(record[name], dt) for name in driven), default=0.0)
    return max(1, int(1 / (dt * max(SET.least_hz, SET.a_period * fastest))))


def _fastest_Hz(values: np.ndarray, dt: float) -> float:
    """The frequency below which lies `below_fastest` of the power of a column without its straight line."""
    ramp = np.linspace(0.0, 1.0, values.size)
    rest = (values - values[0] - (values[-1] - values[0]) * ramp) * np.hanning(values.size)
    power = np.cumsum(np.abs(np.fft.rfft(rest)) ** 2)
    if not power[-1] > 0:
        return 0.0
    return float(np.searchsorted(power, SET.below_fastest * power[-1]) / (values.size * dt))


def _slower(record: Record, step: int) -> Record:
    """One of each `step` rows."""
    if step < 2:
        return record
    count = len(record) // step
    rows = np.arange(count * step).reshape(count, step)
    last = np.full(count, step - 1)
    if USED in record.columns and np.mean(record[USED]) < SET.most_used:
        last -= np.argmax(record[USED][rows[:, ::-1]] > 0, axis=1)
    said = TEXT("slower", step=step)
    return replace(record.rows(rows[np.arange(count), last]), treated=(*(record.treated or ()), said))
