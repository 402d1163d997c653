"""A TOML file that a user wrote, with whatever is wrong with it said in one sentence."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final


def toml_text(tables: Mapping[str, Any], path: str = "") -> str:
    """`tables` as TOML that reads back as the same; keys must be bare ones, values numbers, booleans, text or lists of
    these.
    """
    values = {key: value for key, value in tables.items() if not isinstance(value, Mapping)}
    lines = [f"[{path}]"] if path and (values or not tables) else []
    lines += [f"{key} = {_value(value)}" for key, value in values.items()]
    text = "\n".join([*lines, ""]) + "\n" if lines else ""
    within = f"{path}." if path else ""
    return text + "".join(toml_text(table, within + key) for key, table in tables.items() if isinstance(table, Mapping))


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


LARGEST_FILE: Final = 1 << 20


def read_toml(path: Path, what: str) -> tuple[dict[str, Any], str]:
    """The tables of a file and its text; `what` says in the ValueError of one sentence which kind of file it should
    have been.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"{path}: {what} must be smaller than {LARGEST_FILE} bytes; got {path.stat().st_size}")
        text = path.read_text(encoding="utf-8-sig")
        return tomllib.loads(text), text
    except OSError as error:
        raise ValueError(f"{path}: {what} must be a file that can be read; got: {error.strerror or error}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"{path}: {what} must be TOML; got: {' '.join(str(error).split())[:200]}") from None
