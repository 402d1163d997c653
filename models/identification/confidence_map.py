"""From a search's score to a probability, in words too: an isotonic map fitted to series whose truth is known."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from models.files.toml import parse_toml
from models.identification.settings import SET

MAP: Final = Path(__file__).with_name("confidence.toml")


@dataclass(frozen=True)
class ConfidenceMap:
    """The share `right` of what was said with a `score`, ascending; of `statements` about `series` on a `date`."""

    series: int
    statements: int
    date: str
    score: tuple[float, ...]
    right: tuple[float, ...]

    @property
    def calibrated(self) -> bool:
        """Whether it rests on enough series."""
        return self.series >= SET.calibrated_on and len(self.score) > 0

    @property
    def most(self) -> float:
        """The most that n statements, all of them right, would allow to say: Laplace's (n + 1)/(n + 2)."""
        return (self.statements + 1) / (self.statements + 2)

    def probability(self, score: float) -> float:
        """The share that was right of what was said with `score`, as far as `most` goes; without a map the score."""
        return min(float(np.interp(score, self.score, self.right)), self.most) if self.calibrated else score

    def words(self, probability: float) -> str:
        """What `probability` means, in a sentence."""
        if not self.calibrated:
            return "How often such a finding is right is not calibrated."
        return f"Of 100 series of which this was said, about {100 * probability:.0f} were right."

    @property
    def origin(self) -> str:
        """What it rests on."""
        if not self.calibrated:
            return f"No map on {SET.calibrated_on} series or more is at hand."
        return f"Isotonic map on {self.statements} such findings in {self.series} simulated series, {self.date}."

    def to_toml(self) -> str:
        """As a file that `read_map` reads."""
        head = "".join(line for line in MAP.read_text(encoding="utf-8").splitlines(keepends=True) if line[:1] == "#")
        rows = {name: ", ".join(f"{v:.4g}" for v in getattr(self, name)) for name in ("score", "right")}
        return (
            f'{head}series = {self.series}\nstatements = {self.statements}\ndate = "{self.date}"\n'
            f"score = [{rows['score']}]\nright = [{rows['right']}]\n"
        )


def read_map(path: Path) -> ConfidenceMap:
    """The map of a file. Raises ValueError of one sentence where it is none."""
    raw = parse_toml(path.read_text(encoding="utf-8"), "confidence map")
    try:
        made = ConfidenceMap(
            int(raw["series"]),
            int(raw["statements"]),
            str(raw["date"]),
            tuple(float(v) for v in raw["score"]),
            tuple(float(v) for v in raw["right"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(
            f"{path}: confidence map must have series, statements, date, score, right; got {error}"
        ) from None
    rising = all(list(row) == sorted(row) for row in (made.score, made.right))
    if len(made.score) != len(made.right) or not rising or not all(0 <= v <= 1 for v in made.right):
        raise ValueError(f"{path}: score and right must be as many numbers, both ascending, right in [0, 1]")
    return made


@cache
def confidence_map() -> ConfidenceMap:
    """The map in use."""
    return read_map(MAP)
