"""States as phrases with cause and remedy."""

from collections.abc import Mapping
from typing import Final

from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
_GRADES: Final[Mapping[str, tuple[str, ...]]] = {
    "bad": ("fault", "silent", "broken", "lost"),
    "doubt": ("derated", "quick_stop", "stopping", "doubtful"),
    "good": ("enabled", "running", "holds"),
    "move": ("slips_forward", "slips_backward"),
}


def grade_of(state: str) -> str:
    return next((grade for grade, states in _GRADES.items() if state in states), "note")


def words(name: str) -> str:
    """A name of the catalogue as words: `quick_stop` as "quick stop", `InnerMass` as "inner mass"."""
    spaced = "".join(f" {c.lower()}" if c.isupper() and k else c.lower() for k, c in enumerate(name))
    return spaced.replace("_", " ")


def clock(seconds: float) -> str:
    whole = int(max(seconds, 0.0))
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02d}:{whole % 60:02d}" if hours else f"{minutes}:{whole % 60:02d}"
