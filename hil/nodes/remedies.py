"""What helps where a controller did not lead or stopped early, by the words of the reason."""

from typing import Final

from models.files.toml import beside
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
REASONS: Final[dict[str, list[str]]] = beside(__file__, "remedies.toml")
"""By the key of its sentence, what a reason has in it; the first that fits counts."""


def remedy(ended: str) -> str:
    fits = (key for key, parts in REASONS.items() if any(part in ended for part in parts))
    key = next(fits, "")
    return TEXT(f"remedy.{key}") if key else ""
