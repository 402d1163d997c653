"""The records of the common rigs: `check` refuses none, and each README quotes what was found and when."""

import json
import re
from pathlib import Path

import pytest

from hil.app.main import run
from tests.places import ROOT

RIGS = ("magnetic", "coil", "vibro")


@pytest.mark.parametrize("name", RIGS)
def test_the_records_can_be_used(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = ROOT / "examples" / name
    records = [str(path) for path in sorted(folder.glob("*.csv.gz"))]
    assert [Path(path).name for path in records] == ["held_out.csv.gz", "run_1.csv.gz", "run_2.csv.gz"]
    assert run(["check", *records, "--rig", str(folder / "rig.toml"), "--json"]) == 0
    assert [f["id"] for f in json.loads(capsys.readouterr().out)["findings"] if f["severity"] == "stops"] == []
    readme = (folder / "README.md").read_text()
    assert re.search(r"capsule close-loop run_1\.csv\.gz run_2\.csv\.gz", readme) is not None
    assert re.search(r"20\d\d-\d\d-\d\d", readme) is not None
