"""What close-loop writes of an axis or of a coil by voltage is read by the commands that take a model."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from controller.supervision.acceptance import judge
from hil.app.main import run
from models.identification.finding import STAGES
from models.identification.model import Model
from models.rigs.kinds import drive_of, surface_of
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.rig_texts import GUT

TURNS = {
    "inertia_kg_m2": 0.4, "viscous_friction_N_m_s_per_rad": 1.2, "coulomb_friction_N_m": 2.0, "offset_N_m": 0.2
}  # fmt: skip
LINE = {"mass_kg": 2.0, "viscous_friction_N_s_per_m": 8.0, "coulomb_friction_N": 3.0, "offset_N": 0.5}
STRIBECK = {"excess": 0.6, "speed_rad_s": 0.18, "exponent": 1.4}
PRESLIDING = {"distance_m": 4e-4, "exponent": 1.0}
T = 2e-3 * np.arange(2000)
COIL = '[rig]\nkind = "coil"\nforce_constant_N_per_A = 0.5\ncoil_resistance_Ohm = 10.0\n'


def files(folder: Path, rig: str, values: Theta, columns: Mapping[str, np.ndarray]) -> list[str]:
    """`--model` and `--rig` of a model in every stage, beside record.csv."""
    kind = "coil" if rig.endswith(COIL) else "axis"
    (folder / "rig.toml").write_text(rig)
    (folder / "model.toml").write_text(Model(kind, dict.fromkeys(STAGES, values)).to_toml())
    rows = np.column_stack(list({"t_s": T, **columns}.values()))
    np.savetxt(folder / "record.csv", rows, delimiter=",", header=",".join(["t_s", *columns]), comments="")
    return ["--model", str(folder / "model.toml"), "--rig", str(folder / "rig.toml")]


def written(folder: Path, asked: list[str], *forms: str) -> None:
    assert run(["predict", str(folder / "record.csv"), *asked, "--out", str(folder / "p.csv")]) == 0
    for form in forms:
        out = folder / {"fmu": "m.fmu", "mujoco": "m.xml", "table": "t"}[form]
        assert run(["export", form, *asked, "--out", str(out)]) == 0, form


def test_an_effect_in_the_units_and_of_the_size_of_a_turn(tmp_path: Path) -> None:
    values = Theta(TURNS, effects={"stribeck": STRIBECK})
    moved = {"angle_rad": np.sin(2 * T), "torque_N_m": np.sign(np.cos(2 * T))}
    asked = files(tmp_path, '[rig]\nkind = "axis"\n', values, moved)
    written(tmp_path, asked, "fmu", "table", "mujoco")


def test_a_current_that_turns_an_axis(tmp_path: Path) -> None:
    """Also of a record without its angle."""
    values = Theta({**TURNS, "torque_constant_N_m_per_A": 7.5})
    rig = '[rig]\nkind = "axis"\ndriven = "coil_current_A"\n[axis]\ninertia_kg_m2 = 0.4\n'
    asked = files(tmp_path, rig, values, {"coil_current_A": np.sin(3 * T)})
    written(tmp_path, asked, "fmu")
    assert "angle_rad" in (tmp_path / "p.csv").read_text().splitlines()[0]


def test_of_several_loads_some_have_no_part(tmp_path: Path) -> None:
    effects = {
        "load_force": {"per_pressure_Pa": -3e-5, "slope_per_m": 0.0},
        "load_dependent_friction": {"growth_per_load_1": 0.5},
    }
    moved = {"position_m": 0.1 * np.sin(2 * T), "force_N": np.sign(np.cos(2 * T))}
    loads = {"pressure_Pa": 1e5 + 3e4 * np.sin(T), "load_1": 2 + np.cos(T)}
    asked = files(tmp_path, '[rig]\nkind = "axis"\n', Theta(LINE, effects=effects), {**moved, **loads})
    written(tmp_path, asked)


def test_a_table_leaves_out_friction_with_memory(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    moved = {"position_m": 0.1 * np.sin(2 * T), "force_N": np.sign(np.cos(2 * T))}
    asked = files(tmp_path, '[rig]\nkind = "axis"\n', Theta(LINE, effects={"presliding": PRESLIDING}), moved)
    written(tmp_path, asked, "table", "mujoco")
    assert "not mapped: presliding: depends on time" in capsys.readouterr().out


def test_a_coil_by_voltage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rig.toml").write_text(GUT + COIL)
    rig = read_rig(tmp_path / "rig.toml")
    numbers = (*surface_of(rig).parameters(), *drive_of(rig, "coil_voltage_V").parameters())
    moved = {"coil_voltage_V": np.sin(3 * T), "position_m": 1e-6 * np.sin(9 * T)}
    asked = files(tmp_path, GUT + COIL, Theta.declared(numbers), moved)
    written(tmp_path, asked, "fmu", "table", "mujoco")
    assert '<motor name="coil_current_A"' in (tmp_path / "m.xml").read_text()
    assert "the actuator takes the current" in capsys.readouterr().out
    model = Model.from_toml((tmp_path / "model.toml").read_text())
    assert not [why for why in judge({}, model, rig).reasons if "parameter" in why]


def test_a_driven_torque_of_a_record_along_a_line_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is no free swing: a force is logged."""
    moved = {"position_m": 0.1 * np.sin(2 * T), "force_N": np.sign(np.cos(2 * T))}
    files(tmp_path, '[rig]\nkind = "axis"\ndriven = "torque_N_m"\n', Theta(LINE), moved)
    assert run(["check", str(tmp_path / "record.csv"), "--rig", str(tmp_path / "rig.toml")]) == 2
    assert "driven must be force_N for a record with position_m; got torque_N_m" in capsys.readouterr().err
