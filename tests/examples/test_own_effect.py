"""The example effect is found where it is there: in a record of a model that has it, with noise."""

import json
from pathlib import Path

import numpy as np
import pytest

from hil.app.main import run
from hil.app.write import write_table
from models.effects import Catalogue
from models.identification.kinds import kind_for
from models.records.record import read_record
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.places import ROOT

EXAMPLES = ROOT / "examples"
BUMP = EXAMPLES / "own_effect" / "soft_bump.py"
HIDDEN = Theta.of({("soft_bump", "force_N"): 0.03, ("soft_bump", "place_m"): 4e-3, ("soft_bump", "width_m"): 1.5e-3})


def test_it_is_named_with_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig_file = EXAMPLES / "own_record" / "rig.toml"
    rig, rng = Catalogue.read([BUMP]).given_to(read_rig(rig_file)), np.random.default_rng(3)
    for name in ("pull_1", "pull_2", "held_out"):
        record = read_record(EXAMPLES / "own_record" / f"{name}.csv", rig)
        kind = kind_for(rig, [record])
        write_table(tmp_path / f"{name}.csv", kind.imitate(record, kind.nominal() | HIDDEN, rng).columns)
    records = [str(tmp_path / f"pull_{k}.csv") for k in (1, 2)]
    asked = ["close-loop", *records, "--rig", str(rig_file), "--holdout", str(tmp_path / "held_out.csv")]
    assert run([*asked, "--effects", str(BUMP), "--out", str(tmp_path / "out"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert [effect["id"] for effect in report["effects"]] == ["soft_bump"]
    found = report["effects"][0]["parameters"]
    assert found["place_m"]["value"] == pytest.approx(4e-3, abs=0.5e-3)
    model = (tmp_path / "out" / "model.toml").read_text()
    assert 'file = "soft_bump.py"' in model
