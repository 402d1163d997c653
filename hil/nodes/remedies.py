"""What helps where a controller did not lead or stopped early, by the words of the reason."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
_FILE: Final = Path(__file__).with_name("remedies.toml")
REASONS: Final[Mapping[str, list[str]]] = tomllib.loads(_FILE.read_text(encoding="utf-8"))
"""By the key of its sentence, what a reason has in it; the first that fits counts."""


def remedy(ended: str) -> str:
    """What helps after a run that `ended` so, "" where it ended as asked."""
    fits = (TEXT(f"remedy.{key}") for key, parts in REASONS.items() if any(part in ended for part in parts))
    return next(fits, "")
