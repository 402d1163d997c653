"""States as phrases with cause and remedy."""

from typing import Final

from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


def grade_of(state: str) -> str:
    return TEXT(f"grade.{state}") if f"grade.{state}" in TEXT else "note"


def words(name: str) -> str:
    """A name of the catalogue as words: `quick_stop` as "quick stop", `InnerMass` as "inner mass"."""
    spaced = "".join(f" {c.lower()}" if c.isupper() and k else c.lower() for k, c in enumerate(name))
    return spaced.replace("_", " ")


def clock(seconds: float) -> str:
    whole = int(max(seconds, 0.0))
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02d}:{whole % 60:02d}" if hours else f"{minutes}:{whole % 60:02d}"
