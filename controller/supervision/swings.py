"""Swinging about the reference: what a loop does that is not stable."""

import math


class Swings:
    """Counts how often in a row the capsule goes from further than `far_m` on one side of its reference to as far on
    the other, each time within `within_s` of when it was last as far. An error that stays on one side is no swing.
    """

    def __init__(self, far_m: float, within_s: float) -> None:
        self._far_m, self._within_s = far_m, within_s
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.count, self._side, self._far_at = 0, 0.0, -math.inf

    def see(self, now: float, error_m: float) -> int:
        """A tick on, to `now` in s; how often it has swung by now. An error that is no number is not seen."""
        if now - self._far_at > self._within_s:
            self.forget()
        if abs(error_m) >= self._far_m:
            side = math.copysign(1.0, error_m)
            self.count += side == -self._side
            self._side, self._far_at = side, now
        return self.count
