"""A series as if it had been logged slower and more seldom: rows beyond what a fit needs are left out, and told."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from models.records.record import USED, Record
from models.rigs.columns import TIME
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
MOST_ROWS: Final = 80_000  # of a series in a search
LEAST_HZ: Final = 100.0  # rate that a record keeps: a slip event shows
_A_PERIOD: Final = 50  # samples that remain of the fastest period of the driven column
_POWER: Final = 0.9999  # share of its power that lies below that frequency
_MOST_USED: Final = 0.5  # share of rows with a measured value, from which any row will do
_TOO_MANY: Final = 3.0  # times the most rows, up to which every record remains
_FEWEST: Final = 3  # records that remain


def thinned(records: Sequence[Record], most: float = MOST_ROWS) -> tuple[list[Record], str]:
    """The `records` with about `most` rows in all, and in words what was left out, "" if nothing.

    Of each k rows the last is kept; where few rows have a measured value, the last that has one. A record keeps at
    least `LEAST_HZ`, and 50 samples in the fastest period of its drive. Where thrice `most` remain, records are left
    out evenly; the last one stays.
    """
    rows, kept = sum(map(len, records)), slower(records, most)
    left = sum(map(len, kept))
    if (left == rows and rows <= _TOO_MANY * most) or not all(record.layout.time for record in records):
        return kept, ""
    few = max(_FEWEST, math.floor(len(kept) * min(_TOO_MANY * most / left, 1.0)))
    chosen = sorted({round(k) for k in np.linspace(0, len(kept) - 1, min(few, len(kept)))})
    kept = [kept[k] for k in chosen]
    said = TEXT("thinned", rows=rows, kept=sum(map(len, kept)))
    fewer = f" {TEXT('fewer', records=len(records), chosen=len(kept))}" if len(kept) < len(records) else ""
    return kept, said + fewer


def slower(records: Sequence[Record], most: float = MOST_ROWS) -> list[Record]:
    """All of the `records`, with so few rows at most that their rates allow."""
    wanted = math.ceil(sum(map(len, records)) / most)
    return [_slower(r, min(wanted, longest_step(r)) if wanted > 1 and r.layout.time else 1) for r in records]


def longest_step(record: Record) -> int:
    """Of how many rows one may be kept; all beside an accelerometer, whose readings are means over their intervals."""
    if not record.columns.keys().isdisjoint(record.layout.beside):
        return 1
    t = record[TIME]
    dt = float(np.ptp(t)) / max(len(t) - 1, 1)
    driven = [name for names in record.layout.driven for name in names if name in record.columns]
    fastest = max((_fastest_Hz(record[name], dt) for name in driven), default=0.0)
    return max(1, math.floor(1 / (dt * max(LEAST_HZ, _A_PERIOD * fastest))))


def _fastest_Hz(values: np.ndarray, dt: float) -> float:
    """The frequency below which lies `_POWER` of the power of a column without its straight line."""
    ramp = np.linspace(0.0, 1.0, values.size)
    rest = (values - values[0] - (values[-1] - values[0]) * ramp) * np.hanning(values.size)
    power = np.cumsum(np.abs(np.fft.rfft(rest)) ** 2)
    if not power[-1] > 0:
        return 0.0
    return float(np.searchsorted(power, _POWER * power[-1]) / (values.size * dt))


def _slower(record: Record, step: int) -> Record:
    """One of each `step` rows."""
    if step < 2:
        return record
    count = len(record) // step
    rows = np.arange(count * step).reshape(count, step)
    last = np.full(count, step - 1)
    if USED in record.columns and np.mean(record[USED]) < _MOST_USED:
        last -= np.argmax(record[USED][rows[:, ::-1]] > 0, axis=1)
    said = TEXT("slower", step=step)
    return replace(record.rows(rows[np.arange(count), last]), treated=(*(record.treated or ()), said))
