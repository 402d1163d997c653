"""Where two columns count from, and whether they are exchanged: over strokes to and fro friction acts equally far to
both sides of the middle, against the motion.
"""

from dataclasses import dataclass

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import Array, View
from models.checks.wiring.exchanged import exchanged

_OF_MEDIAN = 1.253 / 0.6745  # standard error of a median by the median deviation and the root of the number


@dataclass(frozen=True)
class _Sides:
    """Median of a signal over the later halves of the longer strokes: half the difference between both ways
    (`friction`), the `middle` between them, and how far these may be off by chance.
    """

    friction: float
    middle: float
    unsure: float

    @property
    def apart(self) -> bool:
        """Whether the middle is further off than friction can explain."""
        return abs(self.middle) > SET.zero_clear * abs(self.friction) + self.unsure


def _sides(view: View, signal: Array, noise: float) -> _Sides | None:
    """None where a way has fewer than two strokes."""
    place = view.record[view.moving_column]
    travels = {stroke: abs(float(place[stroke[1] - 1] - place[stroke[0]])) for stroke in view.strokes}
    least = float(np.median(list(travels.values()))) if travels else 0.0
    ways = [
        np.array(
            [np.mean(signal[(a + b) // 2 : b]) for (a, b, way), d in travels.items() if way == side and d >= least]
        )
        for side in (1.0, -1.0)
    ]
    if min(map(len, ways)) < 2:
        return None
    ahead, back = (float(np.median(way)) for way in ways)
    error = _OF_MEDIAN * float(np.hypot(*(np.median(np.abs(way - np.median(way))) / np.sqrt(len(way)) for way in ways)))
    return _Sides(0.5 * (ahead - back), 0.5 * (ahead + back), max(SET.sure * error, 3 * noise))


def check_place_zero(view: View) -> list[RecordFinding]:
    """Whether a magnet's capsule is behind its carriage both ways, and in the middle on average."""
    if not view.kind.follows or not view.timed or view.driven is None or view.measured not in view.record.columns:
        return []
    sides = _sides(view, view.record[view.driven] - view.y, view.noise)
    if sides is None:
        return []
    late = SET.zero_late_s * float(np.percentile(np.abs(view.speed), 75))
    if -sides.friction > max(sides.unsure, late):
        why = f"{view.measured} runs ahead of {view.driven} both ways, so friction would give energy"
        lead = view.told(-sides.friction)
        how = f"the capsule is {lead} ahead of its magnet over the later halves of the strokes"
        return [exchanged(view, view.driven, why, how)]
    in_air = view.rig.surface is not None and view.rig.surface.kind == "air"
    if not sides.apart or in_air:
        return []
    side = "behind" if sides.middle > 0 else "ahead of"
    return [
        _apart(
            view,
            f"{view.measured} is {view.told(abs(sides.middle))} {side} {view.driven}",
            "the two count from different places, or a force larger than friction pulls the capsule one way",
            -sides.middle,
        )
    ]


def check_force_zero(view: View) -> list[RecordFinding]:
    """Whether the force of a pull lies on both sides of zero as friction does."""
    if not view.kind.drawn or not view.timed or view.measured not in view.record.columns:
        return []
    sides = _sides(view, view.y, view.noise)
    if sides is None or not sides.apart:
        return []
    return [
        _apart(
            view,
            f"{view.measured} is {sides.middle:.3g} N",
            "the load cell was not set to zero, or a weight hangs on it",
            sides.middle,
        )
    ]


def _apart(view: View, sentence: str, why: str, offset: float) -> RecordFinding:
    entry = view.rig.columns.entry(view.measured)
    zero = float(f"{entry.offset + offset / (entry.sign * entry.factor()):.3g}")
    return view.finding(
        "zeros_apart",
        "note",
        f"{view.measured}, throughout",
        f"{sentence} on average over strokes both ways, further off than friction explains: {why}",
        "mean over the later halves of the strokes, each way",
        f"{view.columns_line(view.measured, offset=zero)}, where it is the zero",
    )
