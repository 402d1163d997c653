"""The shipped deployment: a simulated plant in one process, the controller in another, then a replay."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from hil.app.main import run
from hil.app.scenario.deployment import OWN_TABLES, load_deployment, read_plant
from models.rigs.reader import table_names
from tests.hil.app.run.plant_process import CAPSULE, HELD_UP, TRIES
from tests.places import ROOT

FOLDER = ROOT / "examples" / "deployment"


def test_it_names_every_table_of_a_deployment() -> None:
    text = (FOLDER / "deployment.toml").read_text()
    of_records, of_other_rigs = {"checks", "clock", "columns", "prior"}, {"drive", "surface", "axis", "contact"}
    tables = {*OWN_TABLES, *table_names()} - of_records - of_other_rigs
    assert all(f"[{table}]" in text for table in tables)


@pytest.mark.slow
def test_plant_and_controller_meet_on_the_local_bus(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = Path(shutil.copytree(FOLDER, tmp_path / "deployment"))
    file = folder / "deployment.toml"
    text = (
        file.read_text().replace("duration_s = 10.0", "duration_s = 1.5").replace('"deployment"', f'"{tmp_path.name}"')
    )
    file.write_text(text)
    for _ in range(TRIES):
        log = tmp_path / "run.blf"
        with subprocess.Popen(
            [*CAPSULE, "plant", str(file), "--seconds", "60"], stdout=subprocess.PIPE, text=True
        ) as plant:
            assert plant.stdout is not None
            assert plant.stdout.readline() == "ready\n"
            command = [*CAPSULE, "run", str(file), "--log", str(log), "--json"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            plant.terminate()
            assert plant.stdout.read() == ""
        found = json.loads(done.stdout)
        if (
            found["ended"] not in HELD_UP and "the carriage reports" not in found["ended"]
        ):  # of a plant held up meanwhile
            break
    assert (found["ended"], done.returncode, plant.returncode) == ("done", 0, 0)
    assert run(["replay", str(log)]) == 0
    assert "identical" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ("", r"table \[plant\] must have the key"),
        ("[plant]\n", "must have scenario"),
        ('[plant]\nscenario = "plant.toml"\npriority = 100\n', "plant.priority must lie in"),
        ('[plant]\nscenery = "plant.toml"\n', "scenery"),
    ],
)
def test_a_plant_that_is_not_named_is_told_in_a_sentence(tmp_path: Path, table: str, sentence: str) -> None:
    text = (FOLDER / "deployment.toml").read_text()
    file = tmp_path / "deployment.toml"
    file.write_text(text[: text.rindex("[plant]\n")] + table)
    with pytest.raises(ValueError, match=sentence):
        read_plant(file)


def test_the_controller_never_reads_the_plants_file(tmp_path: Path) -> None:
    file = tmp_path / "deployment.toml"
    shutil.copy(FOLDER / "deployment.toml", file)
    assert load_deployment(file).rig.kind == "magnetic"
