"""A place that begins again: an angle that goes on at -180 after 180 degrees, a counter that overflows."""

import numpy as np
from numpy.typing import NDArray

from models.checks.finding import RecordFinding
from models.checks.instrument.resolution import PLACES
from models.checks.settings import SET
from models.checks.view import Array, View, white_noise

_USUAL = (np.pi, 2 * np.pi, 180.0, 360.0, *(2.0**k for k in range(8, 33)))  # angles and counters that begin again


def check_wraps(view: View) -> list[RecordFinding]:
    """Places, measured or driven, that wrap."""
    found = []
    looked_at = {view.moving_column, view.driven, view.measured} & view.record.columns.keys()
    for name in [place for place in PLACES if place in looked_at] if view.timed else ():
        rows = wraps(view.record[name])
        if len(rows):
            found.append(_told(view, name, rows))
    return found


def wraps(values: Array) -> NDArray[np.int64]:
    """Rows before which `values` (n,) jump back through most of their span while they go on as before, (k,); none where
    a jump is of another kind, as that of a command that steps. What flickers to and fro at one passage counts once.
    """
    none, step = np.zeros(0, dtype=np.int64), np.diff(values)
    rows = np.flatnonzero(np.abs(step) > SET.wrap_jump * np.ptp(values)) + 1
    if not len(rows) or len(rows) > SET.wrap_most * len(values):
        return none
    passages = np.split(rows, np.flatnonzero(np.diff(rows) > SET.side) + 1)
    passages = [p for p in passages if len(p) % 2 and p[0] > SET.side and p[-1] < len(values) - SET.side]
    sure, told = 3 * white_noise(values), []
    for passage in passages:
        first, last = passage[0], passage[-1]
        before = np.median(values[first - SET.few : first]) - np.median(
            values[first - SET.side : first - SET.side + SET.few]
        )
        after = np.median(values[last + SET.side - SET.few : last + SET.side]) - np.median(
            values[last : last + SET.few]
        )
        back = -np.sign(values[last] - values[first - 1])
        if min(back * before, back * after) < -sure:
            return none
        told += [first] if min(back * before, back * after) > sure else []
    return np.array(told, dtype=np.int64)


def _told(view: View, name: str, rows: NDArray[np.int64]) -> RecordFinding:
    values = view.record[name]
    jump = np.diff(values)[rows - 1]
    per_sample = (values[rows - 1] - values[rows - SET.side]) / (SET.side - 1)
    after = float(np.mean(np.abs(jump - per_sample))) / abs(view.rig.columns.entry(name).factor())
    usual = min(_USUAL, key=lambda size: abs(np.log(size / after)))
    after = usual if abs(usual / after - 1) < SET.wrap_snapped else after
    return view.finding(
        "place_wraps",
        "stops",
        f"{name}, {view.at(rows)}",
        f"{name} jumps back {'once' if len(rows) == 1 else f'{len(rows)} times'} by"
        f" {view.told(float(np.max(np.abs(jump))))} and goes on as before: an angle or a counter that begins again",
        f"jumps through more than {SET.wrap_jump:.0%} of the span, against the motion on both sides",
        view.columns_line(name, wrap=float(f"{after:.12g}")),
    )
