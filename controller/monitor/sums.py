"""Cumulative sums (Page 1954): evidence for a change that adds up and never falls below none."""

import math
from dataclasses import dataclass

WIDER = 2.5
"""Of a model that has stopped to hold, by how many times what it predicts is further off than before."""
MOST = 6.0
"""Of one second's evidence, so that no single one raises an alarm."""
ABOUT_S = 3.0
"""Seconds before and after the beginning of a sum that count as about it."""


@dataclass(slots=True)
class Sum:
    """`value` of the evidence so far, since when in s it has not been none, and the greatest `surprise` of the seconds
    about that time.
    """

    value: float = 0.0
    since_s: float = 0.0
    surprise: float = 0.0

    def add(self, evidence: float, began_s: float, surprise: float = 0.0) -> None:
        """Add what a stretch that began at `began_s` says: more than 0 speaks for a change. `surprise` is the greatest
        size of a second about then.
        """
        if not math.isfinite(evidence):
            return
        if self.value <= 0:
            self.since_s, self.surprise = began_s, surprise
        elif began_s - self.since_s <= ABOUT_S:
            self.surprise = max(self.surprise, surprise)
        self.value = max(self.value + min(evidence, MOST), 0.0)


def wider(size: float) -> float:
    """Logarithm of how much likelier `size`, in standard deviations, is where these are `WIDER` times as large."""
    return 0.5 * size * size * (1 - 1 / WIDER**2) - math.log(WIDER)


def shifted(size: float, shift: float) -> float:
    """The same where the mean is `shift` standard deviations above 0."""
    return shift * (size - 0.5 * shift)
