"""`capsule init` writes files that the program takes as they are."""

import json
from pathlib import Path

import pytest

from hil.app.init import RECORD, RIG
from hil.app.main import run
from models.records.record import read_record
from models.rigs.kinds import KINDS
from models.rigs.reader import read_rig


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_rig_file_and_record_are_read_as_they_stand(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["init", kind, str(tmp_path / kind), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    rig = read_rig(tmp_path / kind / RIG)
    assert rig.kind == kind
    assert len(read_record(tmp_path / kind / RECORD, rig)) >= KINDS[kind].layout.minimum
    assert all(Path(file).is_file() for file in said["files"])
    text = (tmp_path / kind / RIG).read_text()
    assert all(f"{key} =" in text for key in KINDS[kind].head.model_fields)


@pytest.mark.parametrize("kind", ["axis", "dma", "periods", "friction"])
def test_the_command_that_it_prints_runs(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["init", kind, str(tmp_path), "--json"]) == 0
    command = json.loads(capsys.readouterr().out)["command"].split()
    assert command[0] == "capsule"
    assert run([*command[1:], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == kind


def test_what_stands_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / RECORD).write_text("mine")
    assert run(["init", "pull", str(tmp_path)]) == 2
    assert "no file is overwritten" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [RECORD]
    assert (tmp_path / RECORD).read_text() == "mine"


def test_an_unknown_kind_is_told_with_the_nearest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["init", "magnet", str(tmp_path / "new")]) == 2
    assert "'magnetic'" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_an_axis_that_turns_has_a_template_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["init", "axis", str(tmp_path / "joint"), "--rotary", "--json"]) == 0
    capsys.readouterr()
    rig = read_rig(tmp_path / "joint" / RIG)
    assert rig.axis.inertia_kg_m2 == 0.4
    assert {"angle_rad", "torque_N_m"} <= set(read_record(tmp_path / "joint" / RECORD, rig).columns)
    text = (tmp_path / "joint" / RIG).read_text()
    assert "torque_std_N_m" in text
    assert "mass_kg" not in text
    assert run(["init", "pull", str(tmp_path / "new"), "--rotary"]) == 2
    assert "--rotary must go with KIND axis" in capsys.readouterr().err


def test_what_a_magnetic_rig_may_state_besides_stands_there_as_a_comment_that_works(tmp_path: Path) -> None:
    assert run(["init", "magnetic", str(tmp_path)]) == 0
    path = tmp_path / RIG
    text = path.read_text()
    for table in ("rig.magnet", "surface", "clock"):
        assert f"\n# [{table}]" in text
    told = text.replace("# [surface]", "[surface]\nkind = 'plate'\nfriction_coefficient = 0.3 #")
    path.write_text(told.replace("# [clock]", "[clock] #").replace("# offset_std_s =", "offset_std_s = 0.01 #"))
    rig = read_rig(path)
    assert rig.surface is not None
    assert rig.surface.kind == "plate"
    assert rig.clock is not None
    assert rig.clock.offset_std_s == 0.01
