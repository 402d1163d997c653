"""`capsule export fmu`: what FMPy plays is what runs here."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hil.app.main import run
from models.effects import CATALOGUE
from models.identification.kinds.axis.driven import DrivenAxisKind
from models.identification.kinds.series.simulation import LAUNCH
from models.identification.model import Model
from models.records.record import Record, record_of
from models.rigs.kinds import drive_of, freely, surface_of
from models.rigs.reader import read_rig
from models.theta import Theta
from plant import layout as at
from plant.experiments.scenario import parse_truth
from plant.session import Session
from tests.hil.app.export.conftest import BASE, FOLDS, MAGNET, PULL, SCENARIO, SHAKEN, played
from tests.rig_texts import GUT, PLATE

pytest.importorskip("fmpy")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

VOLTAGE = "coil_voltage_V"
COIL = """
[rig]
kind = "coil"
force_constant_N_per_A = 0.5
coil_resistance_Ohm = 10.0
coil_inductance_H = 0.01
current_limit_A = 1.0
"""
VIBRO = PLATE + '[rig]\nkind = "vibro"\n'
HIDDEN = """
[effects.fold_periodic]
excess = 0.3
[effects.carriage_backlash]
width_m = 4e-4
onset_s = 1.0
"""


def own(text: str, commands: np.ndarray, step_s: float) -> np.ndarray:
    """Position, speed and wall of the plant itself under the same commands."""
    import tomllib

    raw = tomllib.loads(text)
    session = Session(parse_truth({k: v for k, v in raw.items() if k != "reference"})[2])
    rows = []
    for k, value in enumerate(commands):
        session.advance(float(value), (k + 1) * step_s)
        rows.append(session.plant.state[[at.S_X, at.S_V, at.S_U]].copy())
    return np.array(rows).T


def test_plant_in_fmu_sticks_and_slips_as_here(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from fmpy.validation import validate_fmu

    (tmp_path / "s.toml").write_text(SCENARIO + HIDDEN)
    out = tmp_path / "plant.fmu"
    assert run(["export", "fmu", str(tmp_path / "s.toml"), "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [v["name"] for v in said["variables"]][:2] == ["carriage_position_m", "position_m"]
    assert "sensors" in said["not_mapped"]
    assert validate_fmu(str(out)) == []
    t = 1e-3 * np.arange(1, 2001)
    commands = 5e-3 * np.sin(2 * np.pi * 0.8 * t)
    there, here = played(out, commands, 1e-3), own(SCENARIO + HIDDEN, commands, 1e-3)
    assert np.ptp(here[0]) > 3e-3
    assert 0.02 < np.mean(here[1] == 0) < 0.98  # it sticks and it slips
    for name, values in zip(("position_m", "velocity_m_s", "wall_displacement_m"), here, strict=True):
        np.testing.assert_allclose(there[name][1:], values, rtol=0, atol=1e-9, err_msg=name)


def test_shaken_plant_in_fmu_moves_as_here(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SHAKEN)
    assert run(["export", "fmu", str(tmp_path / "s.toml"), "--out", str(tmp_path / "p.fmu")]) == 0
    commands = (np.arange(2000) % 107 < 30) * 1.0
    there, here = played(tmp_path / "p.fmu", commands, 1e-3), own(SHAKEN, commands, 1e-3)
    assert np.ptp(here[0]) > 3e-3
    np.testing.assert_allclose(there["position_m"][1:], here[0], rtol=0, atol=1e-9)


def test_same_numbers_at_any_communication_step(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO)
    assert run(["export", "fmu", str(tmp_path / "s.toml"), "--out", str(tmp_path / "p.fmu")]) == 0
    t = 1e-3 * np.arange(1, 1001)
    fine = played(tmp_path / "p.fmu", 4e-3 * t, 1e-3)["position_m"]
    coarse = played(tmp_path / "p.fmu", 4e-3 * t[24::25], 25e-3)["position_m"]
    np.testing.assert_allclose(coarse, fine[::25], rtol=0, atol=1e-9)


@pytest.mark.parametrize(("kind", "rig"), [("pull", PULL), ("magnetic", MAGNET)])
def test_found_model_in_fmu_predicts_as_here(kind: str, rig: str, folder_with: Callable[..., Path]) -> None:
    from fmpy.validation import validate_fmu

    values = BASE | FOLDS | ({"magnet_stiffness_N_per_m": 24.0} if kind == "magnetic" else {})
    folder = folder_with(kind, rig, values)
    model, out = str(folder / "model.toml"), folder / "found.fmu"
    assert run(["export", "fmu", "--model", model, "--rig", str(folder / "rig.toml"), "--out", str(out)]) == 0
    assert validate_fmu(str(out)) == []
    t = 2e-3 * np.arange(2001)
    command = 6e-3 * np.sin(2 * np.pi * 0.4 * t)
    believed = read_rig(folder / "rig.toml")
    driven, measured = ("position_m", "force_N") if kind == "pull" else ("carriage_position_m", "position_m")
    record = record_of("made", {"t_s": t, driven: command}, believed, driven_only=True)
    here = Model.from_toml(Path(model).read_text()).predict(believed, record)[measured]
    there = played(out, command[1:], 2e-3, first=command[0])[measured]
    assert np.ptp(here) > (0.05 if kind == "pull" else 5e-3)
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-7)


@pytest.mark.parametrize("driven", ["coil_voltage_V", "drive_on"])
def test_found_model_of_a_free_body_predicts_as_here(driven: str, tmp_path: Path) -> None:
    kind, rig, step_s, atol = ("coil", GUT + COIL, 2e-3, 2e-6) if driven == VOLTAGE else ("vibro", VIBRO, 5e-5, 1e-9)
    (tmp_path / "rig.toml").write_text(rig)
    believed = read_rig(tmp_path / "rig.toml")
    numbers = (*surface_of(believed).parameters(), *drive_of(believed, driven).parameters())
    values = Theta.declared(numbers)
    model = Model(kind, dict.fromkeys(("nominal", "calibrated", "augmented"), values))
    (tmp_path / "model.toml").write_text(model.to_toml())
    files = ["--model", str(tmp_path / "model.toml"), "--rig", str(tmp_path / "rig.toml")]
    more = ["--driven", driven] if driven == VOLTAGE else []
    assert run(["export", "fmu", *files, *more, "--out", str(tmp_path / "m.fmu")]) == 0
    k = np.arange(4001)
    command = 2.5 * np.sin(2 * np.pi * 0.7 * step_s * k) if driven == VOLTAGE else (k % 1200 < 360) * 1.0
    record = record_of("made", {"t_s": step_s * k, driven: command}, believed, driven_only=True)
    here = model.predict(believed, record)["position_m"]
    there = played(tmp_path / "m.fmu", command[1:], step_s)["position_m"]
    assert np.ptp(here) > 1e-3
    np.testing.assert_allclose(there, here, rtol=0, atol=atol)


@pytest.mark.parametrize("commanded", [True, False])
def test_found_model_of_an_axis_starts_where_it_is_told_and_predicts_as_here(commanded: bool, tmp_path: Path) -> None:
    """A command holds until the next sample, a measured force changes linearly."""
    driven = 'driven = "force_N"\n' if commanded else ""
    (tmp_path / "rig.toml").write_text(f'[rig]\nkind = "axis"\n{driven}')
    base = {"mass_kg": 95.0, "viscous_friction_N_s_per_m": 200.0, "coulomb_friction_N": 20.0, "offset_N": -3.0}
    effects = {"stribeck": {**CATALOGUE["stribeck"].start(), "excess": 0.5, "speed_m_s": 0.02}}
    values = Theta(base, effects=effects)
    model = Model("axis", dict.fromkeys(("nominal", "calibrated", "augmented"), values))
    (tmp_path / "model.toml").write_text(model.to_toml())
    files = ["--model", str(tmp_path / "model.toml"), "--rig", str(tmp_path / "rig.toml")]
    assert run(["export", "fmu", *files, "--out", str(tmp_path / "m.fmu")]) == 0
    t = 1e-3 * np.arange(6001)
    force = 45.0 * np.sin(2 * np.pi * 0.8 * t) + 12.0 * np.sin(2 * np.pi * 3.1 * t)
    columns = {"t_s": t, "force_N": force, LAUNCH[0]: np.full_like(t, 0.05), LAUNCH[1]: np.full_like(t, 0.02)}
    kind = DrivenAxisKind.from_rig(freely(read_rig(tmp_path / "rig.toml")), [], holds=commanded)
    here = kind.predict(Record("made", "driven_axis", columns), values)
    starts = {"start_position_m": 0.05, "start_velocity_m_s": 0.02}
    there = played(tmp_path / "m.fmu", force[:-1] if commanded else force[1:], 1e-3, force[0], starts)["position_m"]
    assert np.ptp(here) > 5e-3
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-7)


def test_parameters_may_be_set_and_states_kept(folder_with: Callable[..., Path]) -> None:
    import fmpy
    from fmpy.fmi3 import FMU3Slave

    folder = folder_with("pull", PULL, BASE)
    files = ["--model", str(folder / "model.toml"), "--rig", str(folder / "rig.toml")]
    assert run(["export", "fmu", *files, "--out", str(folder / "m.fmu")]) == 0
    told = fmpy.read_model_description(str(folder / "m.fmu"))
    places = {v.name: v.valueReference for v in told.modelVariables}

    def force(friction: float) -> float:
        unit = FMU3Slave(
            guid=told.guid,
            unzipDirectory=fmpy.extract(str(folder / "m.fmu")),
            modelIdentifier=told.coSimulation.modelIdentifier,
            instanceName="one",
        )
        unit.instantiate()
        unit.setFloat64([places["friction_coefficient"]], [friction])
        unit.enterInitializationMode()
        unit.exitInitializationMode()

        def on(first: int, last: int) -> float:
            forces = []
            for k in range(first, last):
                unit.setFloat64([places["position_m"]], [1e-5 * (k + 1)])
                unit.doStep(1e-3 * k, 1e-3)
                forces.append(unit.getFloat64([places["force_N"]])[0])
            return float(max(forces))

        on(0, 100)
        kept = unit.getFMUState()
        found = on(100, 300)
        unit.setFMUState(kept)
        assert on(100, 300) == found
        unit.freeInstance()
        return found

    assert force(0.15) > 1.1 * force(0.082)


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["export", "fmi", "s.toml", "--out", "a.fmu"], "did you mean 'fmu'?"),
        (["export", "fmu", "--out", "a.fmu"], "--model MODEL.toml and --rig RIG.toml"),
        (["export", "fmu", "s.toml", "--out", "a.zip"], "ends in .fmu"),
        (["export", "table", "s.toml", "--out", "t"], "--model and --rig"),
        (["export", "fmu", "missing.toml", "--out", "a.fmu"], "missing.toml"),
        (["export", "fmu", "bad.toml", "--out", "a.fmu"], "'scenario'"),
    ],
)
def test_refusals_are_a_sentence(
    args: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SCENARIO)
    (tmp_path / "bad.toml").write_text(SCENARIO.replace("[scenario]", "[scenrio]"))
    assert run(args) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1
    assert not list(tmp_path.glob("*.fmu"))


def test_no_compiler_is_said(
    folder_with: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folder_with("pull", PULL, BASE)
    monkeypatch.setenv("CAPSULE_COMPILER", "none")
    files = ["--model", str(folder / "model.toml"), "--rig", str(folder / "rig.toml")]
    assert run(["export", "fmu", *files, "--out", str(folder / "a.fmu")]) == 2
    assert "C compiler" in capsys.readouterr().err
    assert not (folder / "a.fmu").exists()
