"""A short motion out and back before the reference: whether the capsule follows the drive, and by how much."""

from typing import Final

import numpy as np

from controller.limits import Envelope
from controller.reference import Trajectory, through
from controller.signals import Array
from controller.supervision.contradiction import CONTRADICT

_STROKE_M: Final = 5e-3  # stroke to each side if the envelope allows it
_SHORT_M: Final = 3e-3  # the same if the capsule's position in its envelope is unknown
_SPEED_M_S: Final = 0.01  # speed of the probe
_SLOW_M_S: Final = 2e-3  # the same for an inner mass
_DWELL_S: Final = 0.2  # rest at each end
_LEAST: Final = 0.4  # least share of the wanted distance that a sound capsule covers
_GAIN: Final = (0.6, 1.65)
"""Travel of a carriage per travel of the dragged capsule: 1, except over folds and narrow segments."""
_DRAGGED_M: Final = 1.5e-3  # distance since it reversed after which a capsule counts as dragged
_FEWEST: Final = 20  # readings that a verdict needs
_MOST: Final = 8192  # readings that are kept


class Probe:
    """`path` leads from the capsule's position to one side, to the other and back: 5 mm with a magnet, else 3 mm. `saw`
    collects the readings. Measured positions `y` must follow the wanted ones `w`: the slope of `y` over `w` is at least
    `_LEAST`. A dragged capsule lags its carriage `c` by a gap that friction sets, `c = a + s y + g sign(w')`: the slope
    `s` lies within `_GAIN`, or one of the two reports is wrong.
    """

    def __init__(self, envelope: Envelope) -> None:
        self.placed = envelope.placed
        self.stroke_m = min(_STROKE_M, 0.5 * envelope.around_m) if envelope.placed else _SHORT_M
        speed = _SLOW_M_S if envelope.shaken else min(_SPEED_M_S, envelope.limits.speed_m_s)
        self.path: Trajectory = through((self.stroke_m, -self.stroke_m, 0.0), speed, _DWELL_S, _DWELL_S)
        self._rows: list[tuple[float, float, float, float]] = []

    def saw(self, position_m: float, drive: float, wanted_m: float, speed_m_s: float) -> None:
        """A reading of the capsule at `position_m`, with the drive, the wanted position and speed at its stamp."""
        if len(self._rows) < _MOST:
            self._rows.append((position_m, drive, wanted_m, speed_m_s))

    def reason(self) -> str:
        """Why the drive must not be used, after the whole path; "" if the capsule followed."""
        rows = np.array(self._rows)
        if len(rows) < _FEWEST:
            return f"the probe needs {_FEWEST} readings of the localisation; it got {len(rows)}"
        position, drive, wanted, speed = rows.T
        slope = float(np.cov(position, wanted)[0, 1] / np.var(wanted, ddof=1))
        if slope < _LEAST:
            what = "moves against" if slope < -_LEAST else "does not answer"
            went = 1e3 * (position.max() - position.min())
            return (
                f"{CONTRADICT}: the capsule {what} the drive, the localisation shows {went:.1f} mm of travel, where"
                f" {2e3 * self.stroke_m:.1f} mm were commanded"
            )
        gain = self._gain(position, drive, np.sign(speed)) if self.placed else 1.0
        low, high = _GAIN
        if not low <= gain <= high:
            return (
                f"{CONTRADICT}: the carriage reports {gain:.2g} times the travel of the capsule that it drags, where"
                f" {low:g} to {high:g} times is possible"
            )
        return ""

    def _gain(self, position: Array, drive: Array, sign: Array) -> float:
        """The slope `s` of the carriage over the capsule, from readings of a dragged capsule; 1 with too few."""
        dragged = np.zeros(position.size, dtype=bool)
        turned = 0
        for k in range(1, position.size):
            turned = k if sign[k] != sign[k - 1] else turned
            dragged[k] = sign[k] != 0 and sign[k] * (position[k] - position[turned]) >= _DRAGGED_M
        if np.count_nonzero(dragged) < _FEWEST:
            return 1.0
        columns = np.column_stack([np.ones(np.count_nonzero(dragged)), position[dragged], sign[dragged]])
        return float(np.linalg.lstsq(columns, drive[dragged], rcond=None)[0][1])
