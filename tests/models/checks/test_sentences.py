"""Every finding that a check yields has its three texts, and gets the values that they ask for."""

import ast
from collections.abc import Iterator
from pathlib import Path

import models.checks
from tests.models.words.test_sentences import asked, texts

ROOM = Path(models.checks.__file__).parent
TEXTS = texts(ROOM / "sentences.toml")
PARTS = ("sentence", "how", "remedy")
GIVEN = {"column", "measured", "driven"}


def cases() -> Iterator[tuple[str, set[str] | None]]:
    """Each case that a check names in a call, and the values given there; None where they are not spelled out."""
    for file in ROOM.glob("*.py"):
        for call in (node for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, ast.Call)):
            if isinstance(call.func, ast.Attribute) and call.func.attr in ("finding", "stops", "weakens", "notes"):
                case = call.args[call.func.attr == "finding"]
                given = {word.arg for word in call.keywords if word.arg}
                whole = all(word.arg for word in call.keywords)
                if isinstance(case, ast.Constant):
                    yield str(case.value), given if whole else None


def text(case: str, part: str) -> str:
    while f"{case}.{part}" not in TEXTS:
        case = case.rpartition(".")[0]
        assert case, part
    return TEXTS[f"{case}.{part}"]


def test_findings_have_their_texts_and_values() -> None:
    found = list(cases())
    assert len(found) > 30
    for case, given in found:
        wanted = set[str]().union(*(asked(text(case, part)) for part in PARTS))
        assert given is None or wanted <= GIVEN | given, case


def test_sentences_are_whole_and_remedies_are_lines() -> None:
    for key, said in TEXTS.items():
        if key.endswith(".sentence"):
            assert said[0].isupper() or said[0] == "{" or said.partition("_")[1], key
            assert said.endswith(".") or said == "{sentence}", key  # of what the reading left out
        elif key.endswith((".how", ".remedy")):
            assert not said.endswith("."), key
