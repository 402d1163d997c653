"""Figures of the docs: those of a command are what the command gives now, all others carry command and date."""

import json
import re
from pathlib import Path

import pytest

from controller.step.library import available
from hil.app.main import run
from tests.places import ROOT, SCENARIOS

DOCS = ROOT / "docs"
RESULTS = sorted((DOCS / "results").glob("*.md"))


@pytest.mark.parametrize("page", RESULTS, ids=[page.stem for page in RESULTS])
def test_each_table_of_results_follows_a_command_and_a_date(page: Path) -> None:
    text = page.read_text()
    first = text.index("\n|")
    assert re.search(r"python -m (tests|pytest)|`capsule ", text[:first]) is not None
    assert re.search(r"20\d\d-\d\d-\d\d", text[:first]) is not None


@pytest.mark.skipif(not available(), reason="needs a C compiler: the figure is that of the controller in C")
def test_the_tracking_error_of_the_export_page_is_that_of_the_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    quoted = re.search(
        r"`(\w+)` with its plant in an FMU has a tracking error of ([0-9.]+) mm rms and ([0-9.]+) mm at most",
        (DOCS / "export.md").read_text(),
    )
    assert quoted is not None
    assert run(["sil", str(SCENARIOS / f"{quoted[1]}.toml"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    found = [1e3 * said["tracking_rmse_m"], 1e3 * said["tracking_max_m"]]
    assert found == pytest.approx([float(quoted[2]), float(quoted[3])], rel=0.02)
