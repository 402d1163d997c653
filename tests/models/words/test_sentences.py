"""Every sentence that stands in a room's `sentences.toml` is used, is filled with what it asks for, and is short."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from string import Formatter

import pytest

from models.words.sentences import Quantity, Sentences, flat
from tests.places import ROOT

MOST_WORDS = 30
FILES = sorted(
    path for room in ("controller", "models", "plant", "hil") for path in (ROOT / room).rglob("sentences.toml")
)


def texts(path: Path) -> dict[str, str]:
    return dict(flat(tomllib.loads(path.read_text(encoding="utf-8"))))


def asked(text: str) -> set[str]:
    return {re.split(r"[.\[]", name)[0] for _, name, _, _ in Formatter().parse(text) if name}


def calls(room: Path) -> Iterator[tuple[str, set[str], bool]]:
    """The keys that the room's files call `TEXT` with, and the values that they give."""
    for file in room.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "TEXT":
                first = node.args[0]
                whole = all(word.arg for word in node.keywords)
                for key in (part.value for part in ast.walk(first) if isinstance(part, ast.Constant)):
                    yield str(key), {word.arg for word in node.keywords if word.arg}, whole


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.parent.relative_to(ROOT)))
def test_sentences_are_used_and_get_what_they_ask_for(path: Path) -> None:
    known, used = texts(path), set()
    source = "".join(file.read_text(encoding="utf-8") for file in path.parent.glob("*.py"))
    for key, given, whole in calls(path.parent):
        if key in known:
            used.add(key)
            assert asked(known[key]) <= given or not whole, key
    for key in known:
        table, _, last = key.rpartition(".")
        asked_for = [f'"{key}"', *([f'"{table}"', f'"{table}.', f'"{last}"'] if table else [])]
        assert key in used or any(text in source for text in asked_for), key


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.parent.relative_to(ROOT)))
def test_sentences_are_short(path: Path) -> None:
    for key, text in texts(path).items():
        for part in re.split(r"(?<=[.;:])\s+", re.sub(r"\{[^}]*\}", "value", text)):
            assert len(part.split()) <= MOST_WORDS, (key, part)


def test_a_sentence_writes_its_numbers(tmp_path: Path) -> None:
    (tmp_path / "sentences.toml").write_text(
        'a = "{error:in m} of {share:in %}, {ratio:2}, {names:or}, {n} {n:record|records}, {size}, {x}"', "utf-8"
    )
    text = Sentences(str(tmp_path / "any.py"))
    one = text("a", error=2.5e-5, share=0.126, ratio=1.239, names=["b", "c"], n=1, size=Quantity(0.02, "N"), x=1.23456)
    assert one == "25 µm of 13 %, 1.2, b or c, 1 record, 20 mN, 1.23"
    many = text("a", error=2.5e-5, share=0.126, ratio=1.239, names=["b", "c"], n=2, size="-", x="s")
    assert many == "25 µm of 13 %, 1.2, b or c, 2 records, -, s"
