"""An axis whose force is driven: exact stick and slip, either direction from the same records, free swings, EMPS."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from models.effects.effect import Signals
from models.identification import close
from models.identification.kinds import kind_for
from models.identification.kinds.axis.driven import DrivenAxisKind
from models.records.record import Record, read_record, record_of
from models.rigs.reader import parse_rig
from models.theta import Theta

DRIVEN = parse_rig({"rig": {"kind": "axis", "driven": "force_N"}})
NUMBERS = {"mass_kg": 2.0, "viscous_friction_N_s_per_m": 0.0, "coulomb_friction_N": 3.0, "offset_N": 0.5}


def pushed(force: Any, seconds: float = 2.0, x: float = 0.0) -> Record:
    """A record of a force over time, at rest at `x` when it begins."""
    t = np.arange(0, seconds, 1e-3)
    place = np.full(t.size, x)
    place[60:] += 1e-4 * np.sin(40 * t[60:])  # what a run must not look at
    return record_of("pushed", {"t_s": t, "position_m": place, "force_N": force(t)}, DRIVEN)


def run(record: Record) -> np.ndarray:
    kind = kind_for(DRIVEN, [record])
    return np.asarray(kind.predict(kind.driven(record), Theta.of(NUMBERS.items())))


def test_within_its_friction_an_axis_rests_exactly() -> None:
    x = run(pushed(lambda t: 0.5 + 2.9 * np.sin(3 * t), x=0.25))
    assert np.ptp(x) == 0.0
    assert x[0] == pytest.approx(0.25, abs=1e-9)


def test_a_push_moves_it_along_its_parabola_and_it_comes_to_rest_where_it_must() -> None:
    """7.5 N for 0.4 s: 2 m/s2 up to 0.8 m/s; then friction stops it, with the offset, within v m/(3 + 0.5) s."""
    x = run(pushed(lambda t: np.where(t < 0.3995, 7.5, 0.0)))
    t = np.arange(x.size) * 1e-3
    up = (t > 0.01) & (t < 0.39)
    assert np.max(np.abs(x - 0.5 * 2.0 * (t + 1e-3) ** 2)[up]) < 2e-3 * 0.4
    rest = 0.5 * 2.0 * 0.4**2 + 0.8**2 / (2 * 3.5 / 2.0)
    assert x[-1] == pytest.approx(rest, abs=2e-3)
    assert np.ptp(x[t > 0.4 + 0.8 / 1.75 + 0.01]) == 0.0


@pytest.fixture(scope="module")
def train(shared: Path) -> Path:
    return shared / "data" / "emps" / "train.csv"


def test_its_run_costs_milliseconds(train: Path) -> None:
    """Of 24,841 rows, eight at once, in processor time."""
    import time

    record = read_record(train, DRIVEN)
    kind = kind_for(DRIVEN, [record])
    thetas = [kind.nominal()] * 8
    kind.stacked(record, thetas, 1)
    began = time.process_time()
    for _ in range(5):
        kind.stacked(record, thetas, 1)
    assert (time.process_time() - began) / 40 < 3e-3


def test_the_rig_file_or_the_columns_say_what_drives_and_it_is_told(tmp_path: Path) -> None:
    t = np.arange(0, 1, 1e-3)
    columns = {"t_s": t, "position_m": 0.01 * np.sin(5 * t), "force_N": np.cos(5 * t)}
    plain = parse_rig({"rig": {"kind": "axis"}})
    measured = record_of("r", columns, plain)
    assert measured.layout.measured == ("force_N",)
    assert "force_N is measured" in measured.notes[0]
    driven = record_of("r", columns, DRIVEN)
    assert (driven.layout.measured, driven.notes) == (("position_m",), ())
    command = record_of("r", columns | {"command_V": columns["force_N"] / 35.0}, plain)
    assert "35 times command_V" in command.notes[0]
    current = {"t_s": t, "position_m": columns["position_m"], "coil_current_A": columns["force_N"]}
    with pytest.raises(ValueError, match="force_constant_N_per_A"):
        record_of("r", current, plain)
    by_current = record_of("r", current, parse_rig({"rig": {"kind": "axis"}, "axis": {"force_constant_N_per_A": 3.0}}))
    assert by_current["force_N"] == pytest.approx(3.0 * columns["force_N"])
    assert "coil_current_A drives and position_m is measured" in by_current.notes[0]
    assert isinstance(kind_for(plain, [by_current]), DrivenAxisKind)
    with pytest.raises(ValueError, match="driven must be one of"):
        parse_rig({"rig": {"kind": "axis", "driven": "position_m"}})


def swing(inertia: float, gravity: float, coulomb: float, seed: int = 0) -> dict[str, Any]:
    """A pendulum let go at 1.2 rad, with friction settled in steps of 0.1 ms."""
    rng, step, fine = np.random.default_rng(seed), 2e-3, 20
    t = np.arange(0, 12, step)
    angle, q, v = np.empty(t.size), 1.2, 0.0
    for k in range(t.size):
        angle[k] = q
        for _ in range(fine):
            free = v - step / fine / inertia * (gravity * np.sin(q) + 0.01 * v)
            v = np.sign(free) * max(abs(free) - step / fine / inertia * coulomb, 0.0)
            q += step / fine * v
    return {"t_s": t, "angle_rad": angle + 1e-4 * rng.standard_normal(t.size)}


def test_a_free_swing_is_a_run_without_a_force_and_names_its_gravity() -> None:
    rig = parse_rig({"rig": {"kind": "axis", "driven": "torque_N_m"}, "axis": {"inertia_kg_m2": 0.19}})
    record = record_of("swing", swing(0.19, 3.32, 0.02), rig)
    assert "swings freely" in record.notes[0]
    finding, _ = close(rig, [record], [], lambda *_: None)
    assert finding.quantity == "angle_rad"
    (gravity,) = (effect for effect in finding.effects if effect.id == "gravity_over_angle")
    low, high = gravity.parameters["torque_N_m"].ci95
    assert low < 3.32 < high < 4.2
    assert finding.calibration["coulomb_friction_N_m"].value == pytest.approx(0.02, rel=0.3)


@pytest.fixture(scope="module")
def emps(train: Path) -> tuple[Record, Any, Any]:
    record = read_record(train, DRIVEN)
    return record, *close(DRIVEN, [record], [], lambda *_: None)


def test_emps_runs_free_from_its_force_and_its_effect_is_found(emps: tuple[Record, Any, Any]) -> None:
    record, finding, model = emps
    assert finding.quantity == "position_m"
    assert [effect.id for effect in finding.effects] == ["directional_asymmetry"]
    error = finding.error["train"]
    assert error["calibrated"] < 3.5e-3
    assert error["augmented"] < 2.5e-3
    numbers = finding.calibration
    assert numbers["mass_kg"].ci95[0] < 95.11 < numbers["mass_kg"].ci95[1]
    assert numbers["viscous_friction_N_s_per_m"].ci95[0] < 203.5 < numbers["viscous_friction_N_s_per_m"].ci95[1]
    predicted = model.predict(DRIVEN, record)
    assert list(predicted) == ["t_s", "position_m"]
    off = float(np.sqrt(np.mean((predicted["position_m"] - record["position_m"]) ** 2)))
    assert off == pytest.approx(error["augmented"], rel=1e-6)


def test_a_model_of_one_direction_predicts_in_the_other(emps: tuple[Record, Any, Any], train: Path) -> None:
    plain = parse_rig({"rig": {"kind": "axis"}})
    record = read_record(train, plain)
    predicted = emps[2].predict(plain, record)
    off = predicted["force_N"] - record["force_N"]
    assert np.linalg.norm(off) < 0.06 * np.linalg.norm(record["force_N"])


def test_a_run_and_the_inverse_dynamics_have_the_same_effects(train: Path) -> None:
    """But those of a logged load, and of the drive; an effect's hooks are one declaration."""
    record = read_record(train, DRIVEN)
    plain = parse_rig({"rig": {"kind": "axis"}})
    driven, imposed = kind_for(DRIVEN, [record]), kind_for(plain, [read_record(train, plain)])
    ids = {e.id for e in imposed.effects if not {"load", "logged"} & {*e.needs}} - {"presliding"}
    drives = {"actuator_lag", "actuator_saturation", "actuator_dead_zone", "drive_play"}
    assert {effect.id for effect in driven.effects} == ids | drives
    s = Signals(t=0.1, x=0.02, v=0.01, direction=1.0)
    for name in ids:
        one, other = driven.declared(name), imposed.declared(name)
        assert one().level(s, one.start(), {}) == other().level(s, other.start(), {})
