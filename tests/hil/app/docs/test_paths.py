"""Paths, modules, commands and links that the documentation names are there."""

import re
from importlib.util import find_spec
from itertools import product
from pathlib import Path

import pytest

from hil.app.main import COMMANDS
from tests.places import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def spread(path: str) -> list[str]:
    """`kinds/{a,b}/x.py` as `kinds/a/x.py` and `kinds/b/x.py`."""
    parts = re.split(r"\{([^}]*)\}", path)
    choices = [part.split(",") if k % 2 else [part] for k, part in enumerate(parts)]
    return ["".join(one) for one in product(*choices)]


@each_page
def test_paths_into_the_code_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"(?<![\w/.])((?:models|controller|plant|hil|tests)/[\w/.*{},-]*[\w/*])", text)
    assert [path for name in named for path in spread(name) if not list(ROOT.glob(path.rstrip("/")))] == []


@each_page
def test_modules_that_are_run_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"python -m\s+((?:hil|tests|models|plant|controller)[\w.]+)", text)
    assert [name for name in named if find_spec(name) is None] == []


@each_page
def test_commands_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert set(re.findall(r"(?:`|^ +)capsule ([a-z][a-z-]+)", text, re.M)) <= set(COMMANDS)


@each_page
def test_links_lead_somewhere(page: Path) -> None:
    """Anchors are checked by `make docs`."""
    text = page.read_text(encoding="utf-8")
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link]
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_the_readme_stays_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 100
