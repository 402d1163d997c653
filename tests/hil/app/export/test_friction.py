"""`capsule export table` and `capsule export mujoco`: the friction that the model slides with."""

import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from hil.app.main import run
from models.effects import CATALOGUE
from models.identification.model import Model
from models.records.record import record_of
from models.rigs.reader import read_rig
from tests.hil.app.export.conftest import BASE, FOLDS, MAGNET, PULL

TRAVEL_M = 0.0365  # five folds


def exported(folder: Path, form: str, out: str, capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    """What `capsule export FORM --json` says of the model in the folder."""
    files = ["--model", str(folder / "model.toml"), "--rig", str(folder / "rig.toml")]
    assert run(["export", form, *files, "--out", str(folder / out), "--json"]) == 0
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def pulled(folder: Path, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Places and forces of the model pulled at `speed` over the folds, without the first 3 mm."""
    t = np.arange(0.0, TRAVEL_M / speed, 1e-5 / speed)
    believed = read_rig(folder / "rig.toml")
    record = record_of("pull", {"t_s": t, "position_m": speed * t}, believed, driven_only=True)
    force = Model.from_toml((folder / "model.toml").read_text()).predict(believed, record)["force_N"]
    moving = speed * t > 3e-3
    return (speed * t)[moving], force[moving]


def test_table_is_the_friction_that_a_pull_of_the_model_shows(
    folder_with: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folder_with("pull", PULL, BASE | FOLDS)
    exported(folder, "table", "t", capsys)
    table = np.genfromtxt(folder / "t" / "friction.csv", delimiter=",", names=True)
    about = json.loads((folder / "t" / "friction.json").read_text())
    assert set(about["columns"]) == set(table.dtype.names)
    for speed in (1e-3, 5e-3):
        x, force = pulled(folder, speed)
        rows = table[(np.abs(table["speed_m_s"] - speed) < 1e-9) & (table["direction"] == 1)]
        within = (rows["place_m"] >= x[0]) & (rows["place_m"] <= x[-1])
        assert np.mean(rows["force_N"][within]) == pytest.approx(np.mean(force), rel=0.1)
        assert np.max(rows["peak_N"][within]) == pytest.approx(np.max(force), rel=0.1)
        assert np.ptp(rows["force_N"][within]) > 0.2 * np.mean(rows["force_N"])  # the folds


def test_refused_table_leaves_nothing(folder_with: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    folder = folder_with("pull", PULL, BASE | {"friction_coefficient": -1.0})
    files = ["--model", str(folder / "model.toml"), "--rig", str(folder / "rig.toml")]
    assert run(["export", "table", *files, "--out", str(folder / "t")]) == 2
    assert "friction_coefficient must lie in" in capsys.readouterr().err
    assert not (folder / "t").exists()


def test_what_a_table_cannot_hold_is_said(folder_with: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    effects = ("viscous_drag", "tissue_drying", "carriage_backlash", "sensor_delay")
    values = BASE | {"magnet_stiffness_N_per_m": 24.0}
    for name in effects:
        values = values.with_(name, CATALOGUE[name].start())
    missing = exported(folder_with("magnetic", MAGNET, values), "table", "t", capsys)["not_mapped"]
    assert isinstance(missing, dict)
    assert "viscous_drag" not in missing
    assert "time" in missing["tissue_drying"]
    assert "command" in missing["carriage_backlash"]
    assert "measurement" in missing["sensor_delay"]


@pytest.mark.parametrize(("kind", "rig"), [("pull", PULL), ("magnetic", MAGNET)])
def test_mujoco_slides_under_the_force_that_the_model_needs(
    kind: str, rig: str, folder_with: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    values = BASE | ({"magnet_stiffness_N_per_m": 24.0} if kind == "magnetic" else {})
    folder = folder_with(kind, rig, values)
    said = exported(folder, "mujoco", "body.xml", capsys)
    text = (folder / "body.xml").read_text()
    assert ElementTree.fromstring(text).tag == "mujoco"
    exported(folder, "table", "t", capsys)
    table = np.genfromtxt(folder / "t" / "friction.csv", delimiter=",", names=True)
    off = said["fitted"]["rms_off_N"]  # type: ignore[index]
    assert "friction over position and direction" in said["not_mapped"]  # type: ignore[operator]
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for speed in (2e-3, 2e-2):
        mujoco.mj_resetData(model, data)
        forces, speeds = [], []
        for k in range(4000):
            data.ctrl[0] = speed * k * model.opt.timestep
            mujoco.mj_step(model, data)
            forces.append(data.actuator_force[0])
            speeds.append(data.qvel[0])
        wanted = np.mean(table["force_N"][np.abs(table["speed_m_s"] - speed) < 1e-9])
        assert np.mean(speeds[3000:]) == pytest.approx(speed, rel=0.02)
        assert np.mean(forces[3000:]) == pytest.approx(wanted, abs=3 * off + 0.02 * wanted)


def test_mujoco_has_no_inner_mass(folder_with: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    rig = """
[drive]
inner_mass_kg = 0.074
spring_stiffness_N_per_m = 256.23
force_N = 1.25
reaction_on_body = true
[rig]
kind = "vibro"
"""
    folder = folder_with("vibro", rig, BASE | {"force_N": 1.25, "spring_stiffness_N_per_m": 256.23})
    files = ["--model", str(folder / "model.toml"), "--rig", str(folder / "rig.toml")]
    assert run(["export", "mujoco", *files, "--out", str(folder / "b.xml")]) == 2
    assert "vibro" in capsys.readouterr().err
    assert not (folder / "b.xml").exists()
