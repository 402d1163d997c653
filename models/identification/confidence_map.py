"""From a search's score to a probability: an isotonic map fitted to simulated series whose truth is known."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from models.files.toml import parse_toml
from models.identification.settings import SET
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
MAP: Final = Path(__file__).with_name("confidence.toml")


@dataclass(frozen=True)
class ConfidenceMap:
    """The share `right` of the findings with a `score`, ascending; from `statements` about `series` on a `date`."""

    series: int
    statements: int
    date: str
    score: tuple[float, ...]
    right: tuple[float, ...]

    @property
    def calibrated(self) -> bool:
        """Whether it comes from enough series."""
        return self.series >= SET.calibrated_on and len(self.score) > 0

    @property
    def most(self) -> float:
        """The largest probability that n right statements support: Laplace's (n + 1)/(n + 2)."""
        return (self.statements + 1) / (self.statements + 2)

    def probability(self, score: float) -> float:
        """The share that was right of findings with `score`, at most `most`; without a map the score."""
        return min(float(np.interp(score, self.score, self.right)), self.most) if self.calibrated else score

    def words(self, probability: float) -> str:
        """What `probability` means, in a sentence."""
        if not self.calibrated:
            return TEXT("confidence.unknown")
        return TEXT("confidence.meaning", percent=f"{100 * probability:.0f}")

    @property
    def origin(self) -> str:
        """What it comes from, in a sentence."""
        if not self.calibrated:
            return TEXT("confidence.no_origin", series=SET.calibrated_on)
        return TEXT("confidence.origin", **vars(self))


def read_map(path: Path) -> ConfidenceMap:
    """The map of a file that `tests/bench/bench_calibration.py` wrote."""
    raw: Any = parse_toml(path.read_text(encoding="utf-8"), "confidence map")
    return ConfidenceMap(raw["series"], raw["statements"], raw["date"], tuple(raw["score"]), tuple(raw["right"]))


@cache
def confidence_map() -> ConfidenceMap:
    """The map in use."""
    return read_map(MAP)
