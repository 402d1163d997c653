"""The sentences of a room: they stand in its `sentences.toml`, and numbers are formatted as they are filled in."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from string import Formatter
from typing import Any

from models.words.quantities import number, percent, quantity


@dataclass(frozen=True)
class Quantity:
    """A value and its SI unit, which a sentence prints with a prefix: `Quantity(2e-3, "m")` as "2 mm"."""

    value: float
    unit: str

    def __str__(self) -> str:
        return quantity(self.value, self.unit)


class Sentences:
    """The sentences of the room that `file` lies in: `Sentences(__file__)("key", error=2e-3)`; a key within a table has
    the table's name and a point before it.

    A place for a value may state how it is written: `{error:in m}` a quantity in an SI unit, with a prefix;
    `{share:in %}` a share in per cent; `{ratio:2}` so many significant digits; `{names:and}` a list in words;
    `{count:record|records}` the word for one or for any other number. Else a number has three digits.
    """

    def __init__(self, file: str) -> None:
        self._path = Path(file).with_name("sentences.toml")

    def __call__(self, key: str, /, **values: Any) -> str:
        return _FORMATTER.vformat(_texts(self._path)[key], (), values)

    def __contains__(self, key: str) -> bool:
        return key in _texts(self._path)


class _InWords(Formatter):
    """Fills a sentence."""

    def format_field(self, value: Any, spec: str) -> str:
        if "|" in spec:
            one, other = spec.split("|")
            return one if value == 1 else other
        if spec in ("and", "or"):
            return listed(value, spec)
        if spec == "in %":
            return percent(value)
        if spec.startswith("in "):
            return quantity(value, spec[3:])
        if spec.isdigit():
            return number(value, int(spec))
        return number(value, 3) if isinstance(value, float) and not spec else super().format_field(value, spec)


_FORMATTER = _InWords()


@cache
def _texts(path: Path) -> Mapping[str, str]:
    return dict(flat(tomllib.loads(path.read_text(encoding="utf-8"))))


def flat(tables: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, str]]:
    """Keys and texts of `tables`, each text on one line."""
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{within}{key}.")
        else:
            yield f"{within}{key}", " ".join(value.split())


def listed(words: Iterable[object], last_word: str = "and") -> str:
    """`a, b and c`."""
    *first, last = list(map(str, words)) or [""]
    return f"{', '.join(first)} {last_word} {last}" if first else last


def sentence(text: str) -> str:
    """`text` from a capital to a full stop."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}." if text else ""
