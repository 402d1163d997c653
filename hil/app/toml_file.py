"""A TOML file that a user wrote, with whatever is wrong with it said in one sentence."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Final

LARGEST_FILE: Final = 1 << 20


def read_toml(path: Path, what: str) -> tuple[dict[str, Any], str]:
    """The tables of a file and its text; `what` says in the ValueError of one sentence which kind of file it should have been."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"{path}: {what} must be smaller than {LARGEST_FILE} bytes; got {path.stat().st_size}")
        text = path.read_text(encoding="utf-8-sig")
        return tomllib.loads(text), text
    except OSError as error:
        raise ValueError(f"{path}: {what} must be a file that can be read; got: {error.strerror or error}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"{path}: {what} must be TOML; got: {' '.join(str(error).split())[:200]}") from None
