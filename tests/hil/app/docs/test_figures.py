"""Figures of the docs carry their command and date."""

import re
from pathlib import Path

import pytest

from tests.places import ROOT

DOCS = ROOT / "docs"
RESULTS = sorted((DOCS / "results").glob("*.md"))


@pytest.mark.parametrize("page", RESULTS, ids=[page.stem for page in RESULTS])
def test_each_table_of_results_follows_a_command_and_a_date(page: Path) -> None:
    text = page.read_text()
    first = text.index("\n|")
    assert re.search(r"python -m (tests|pytest)|`capsule ", text[:first]) is not None
    assert re.search(r"20\d\d-\d\d-\d\d", text[:first]) is not None
