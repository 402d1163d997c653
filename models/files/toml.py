"""A TOML file that a user wrote, with whatever is wrong with it said in one sentence."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from models.files.source import LARGEST_TEXT, read_text


def toml_text(tables: Mapping[str, Any], path: str = "") -> str:
    """`tables` as TOML that reads back as the same; keys must be bare ones, values numbers, booleans, text or lists of
    these or of tables.
    """
    values = {key: value for key, value in tables.items() if not isinstance(value, Mapping)}
    lines = [f"[{path}]"] if path and (values or not tables) else []
    lines += [f"{key} = {_value(value)}" for key, value in values.items()]
    text = "\n".join([*lines, ""]) + "\n" if lines else ""
    within = f"{path}." if path else ""
    return text + "".join(toml_text(table, within + key) for key, table in tables.items() if isinstance(table, Mapping))


def inline_table(table: Mapping[str, Any]) -> str:
    """A table on one line. Keys and values as `toml_text`."""
    return "{" + ", ".join(f"{key} = {_value(value)}" for key, value in table.items()) + "}"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return inline_table(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def parse_toml(text: str, what: str) -> dict[str, Any]:
    """The tables of a TOML text; a ValueError of one sentence, which begins with `what`, where it is none."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of more digits than Python reads is a plain ValueError
        raise ValueError(f"{what} must be TOML; got: {' '.join(str(error).split())[:200]}") from None


@contextmanager
def in_file(path: Path) -> Iterator[None]:
    """Within it, a ValueError begins with the file that it is about."""
    try:
        yield
    except ValueError as error:
        said = str(error).startswith((f"{path}:", f"{path.parent}/"))
        raise ValueError(str(error) if said else f"{path}: {error}") from None


def read_toml(path: Path, what: str, largest: int = LARGEST_TEXT) -> tuple[dict[str, Any], str]:
    """The tables of a file and its text. Errors as `models.files.source.read_text`."""
    text = read_text(path, what, largest)
    return parse_toml(text, f"{path}: {what}"), text
