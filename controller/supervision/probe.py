"""A short motion to and fro before the reference: whether the capsule goes where the drive goes, and as far."""

from typing import Final

import numpy as np

from controller.limits import Envelope
from controller.reference import Trajectory, through
from controller.signals import Array
from controller.supervision.contradiction import CONTRADICT

_STROKE_M: Final = 5e-3  # way to and fro where the envelope allows it
_SHORT_M: Final = 3e-3  # the same where the capsule's place in its envelope is unknown
_SPEED_M_S: Final = 0.01  # at which the probe is driven
_SLOW_M_S: Final = 2e-3  # the same of a capsule that its drive shakes
_DWELL_S: Final = 0.2  # rest at each end
_LEAST: Final = 0.4
"""Share of the way asked for that a sound capsule goes."""
_GAIN: Final = (0.6, 1.65)
"""Way of a carriage for a way of the capsule that it drags, once it does: 1, folds and a narrow place apart."""
_DRAGGED_M: Final = 1.5e-3  # way since it turned, after which a capsule counts as dragged along
_FEWEST: Final = 20  # readings that a verdict needs
_MOST: Final = 8192  # readings that are kept


class Probe:
    """`path` leads from where the capsule is to one side, to the other and back: 5 mm behind a magnet, 3 mm else. `saw`
    takes what was told on the way. Told positions `y` must follow the wanted ones `w`: the slope of `y` over `w` is at
    least `_LEAST`. A capsule that is dragged is behind its carriage `c` by a gap that friction sets, `c = a + s y + g
    sign(w')`: the slope `s` lies within `_GAIN`, or one of the two is told wrongly.
    """

    def __init__(self, envelope: Envelope) -> None:
        self.placed = envelope.placed
        self.stroke_m = min(_STROKE_M, 0.5 * envelope.around_m) if envelope.placed else _SHORT_M
        speed = _SLOW_M_S if envelope.shaken else min(_SPEED_M_S, envelope.limits.speed_m_s)
        self.path: Trajectory = through((self.stroke_m, -self.stroke_m, 0.0), speed, _DWELL_S, _DWELL_S)
        self._rows: list[tuple[float, float, float, float]] = []

    def saw(self, place_m: float, drive: float, wanted_m: float, speed_m_s: float) -> None:
        """A reading of the capsule at `place_m`, with where the drive was then, and the wanted position and speed."""
        if len(self._rows) < _MOST:
            self._rows.append((place_m, drive, wanted_m, speed_m_s))

    def reason(self) -> str:
        """Why the drive is not to be led, once all of the path was driven; "" where the capsule answered."""
        rows = np.array(self._rows)
        if len(rows) < _FEWEST:
            return f"the probe needs {_FEWEST} readings of the localisation; it got {len(rows)}"
        place, drive, wanted, speed = rows.T
        slope = float(np.cov(place, wanted)[0, 1] / np.var(wanted, ddof=1))
        if slope < _LEAST:
            what = "goes the other way than" if slope < -_LEAST else "does not answer"
            went = 1e3 * (place.max() - place.min())
            return (
                f"{CONTRADICT}: the capsule {what} the drive, it is told to have gone {went:.1f} mm where"
                f" {2e3 * self.stroke_m:.1f} mm to and fro were asked for"
            )
        gain = self._gain(place, drive, np.sign(speed)) if self.placed else 1.0
        low, high = _GAIN
        if not low <= gain <= high:
            return (
                f"{CONTRADICT}: the carriage is told to go {gain:.2g} times as far as the capsule that it drags, where"
                f" {low:g} to {high:g} times is possible"
            )
        return ""

    def _gain(self, place: Array, drive: Array, way: Array) -> float:
        """The slope `s` of the carriage over the capsule, from readings on which it was dragged; 1 with too few."""
        dragged = np.zeros(place.size, dtype=bool)
        turned = 0
        for k in range(1, place.size):
            turned = k if way[k] != way[k - 1] else turned
            dragged[k] = way[k] != 0 and way[k] * (place[k] - place[turned]) >= _DRAGGED_M
        if np.count_nonzero(dragged) < _FEWEST:
            return 1.0
        columns = np.column_stack([np.ones(np.count_nonzero(dragged)), place[dragged], way[dragged]])
        return float(np.linalg.lstsq(columns, drive[dragged], rcond=None)[0][1])
