"""The ranges of the signals that training records covered, and what a prediction or a motion reaches beyond them."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from models.files.units import unit_at_end
from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.columns import TIME
from models.rigs.kinds import KINDS

Ranges = Mapping[str, tuple[float, float]]
"""Least and greatest value of signals by name."""
DRIVEN_AT: Final = "drive_frequency_Hz"


def ranges_of(kind: Kind, records: Sequence[Record], predicted: Mapping[str, Array] | None = None) -> dict[str, Any]:
    """The ranges of the signals over `records`, time from each one's start; `predicted` columns stand for measured
    ones. A signal counts that is a driven column or ends in a unit; of vibrating rigs also the drive's frequency.
    """
    found: dict[str, list[Array]] = {}
    for record in records:
        more = {name: y for name, y in (predicted or {}).items() if name in kind.quantities and len(y) == len(record)}
        for name, values in _signals(kind, record.with_columns(more)).items():
            found.setdefault(name, []).append(values[np.isfinite(values)])
    joined = {name: np.concatenate(parts) for name, parts in found.items()}
    return {name: (float(values.min()), float(values.max())) for name, values in joined.items() if len(values)}


def _signals(kind: Kind, record: Record) -> dict[str, Array]:
    driven = [name for names in record.layout.driven for name in names if name in record.columns]
    signals = {name: y for name, y in kind.signals(record).items() if unit_at_end(name)[1] or name in driven}
    if TIME not in signals:
        return signals
    t = signals[TIME] = record[TIME] - record[TIME][0]
    if not KINDS[record.kind].vibrates or len(t) < 2 or not driven:
        return signals
    power = np.abs(np.fft.rfft(record[driven[0]] - record[driven[0]].mean()))
    return signals | {DRIVEN_AT: np.fft.rfftfreq(len(t), t[-1] / (len(t) - 1))[[int(np.argmax(power))]]}


def motion_ranges(times: Array, places: Array, speeds: Array) -> dict[str, tuple[float, float]]:
    """The ranges of a motion of the capsule: `times` (n,) in s from its start, places in m, speeds in m/s."""
    way = float(np.sum(np.abs(np.diff(places))))
    ends = {name: (float(y.min()), float(y.max())) for name, y in (("x_m", places), ("v_m_s", speeds))}
    return {TIME: (0.0, float(times[-1])), **ends, "travelled_m": (0.0, way)}


def beyond(covered: Ranges, reached: Ranges) -> dict[str, dict[str, list[float]]]:
    """The signals whose range `reached` leaves the one `covered` by more than 2 % of its span (of its value, where that
    is one), each with both: the key `beyond_records` of JSON.
    """
    out = {}
    for name in (name for name in reached if name in covered):
        (low, high), (least, most) = covered[name], reached[name]
        margin = SET.beyond * ((high - low) or abs(high))
        if least < low - margin or most > high + margin:
            out[name] = {"covered": [low, high], "reached": [least, most]}
    return out
