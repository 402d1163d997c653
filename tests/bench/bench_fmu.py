"""How long FMUs take beside our own simulation and prediction, and how far off they are: `pytest -s
tests/bench/bench_fmu.py`.
"""

import time
from pathlib import Path

import numpy as np
import pytest

from hil.app.export.fmu_archive import fmu
from hil.app.export.fmu_model import model_unit
from hil.app.export.fmu_plant import plant_unit, read_truth
from hil.app.export.found import read_found
from models.identification.model import Model
from models.records.record import record_of
from models.rigs.reader import read_rig
from plant import layout as at
from plant.session import Session
from tests.hil.app.export.conftest import BASE, FOLDS, MAGNET, PULL, played
from tests.places import SCENARIOS
from tests.rig_texts import GUT

TICK_S = 1e-3
RIGS = {
    "sil_magnetic_hidden_folds": lambda t: 6e-3 * np.sin(2 * np.pi * 0.3 * t),
    "track_magnet_pair": lambda t: 6e-3 * np.sin(2 * np.pi * 0.3 * t),
    "track_coil_folds": lambda t: 2.0 * np.sin(2 * np.pi * 0.5 * t),
    "track_vibro_gut": lambda t: (np.mod(t, 0.05) < 0.02) * 1.0,
}


@pytest.mark.parametrize("name", list(RIGS))
def test_plant(name: str, tmp_path: Path) -> None:
    _, rig = read_truth(SCENARIOS / f"{name}.toml")
    began = time.perf_counter()
    (tmp_path / "p.fmu").write_bytes(fmu(plant_unit("plant", rig, 20.0)))
    made_s = time.perf_counter() - began
    commands = RIGS[name](TICK_S * np.arange(1, 20001))
    played(tmp_path / "p.fmu", commands[:10], TICK_S)
    began = time.perf_counter()
    there = played(tmp_path / "p.fmu", commands, TICK_S)["position_m"][1:]
    fmu_s = time.perf_counter() - began
    session, here = Session(rig), np.empty(commands.size)
    began = time.perf_counter()
    for k, command in enumerate(commands):
        session.advance(float(command), (k + 1) * TICK_S)
        here[k] = session.plant.state[at.S_X]
    own_s = time.perf_counter() - began
    off = float(np.max(np.abs(there - here)))
    print(f"\n{name}: made in {made_s:.1f} s; 20 s played in {fmu_s:.2f} s, own session {own_s:.2f} s, ratio")
    print(f"  {fmu_s / own_s:.2f}; off by {off:.1e} m of {np.ptp(here):.1e} m")
    assert off < 1e-9


@pytest.mark.parametrize(("kind", "rig"), [("pull", PULL), ("magnetic", MAGNET)])
def test_model(kind: str, rig: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(GUT + rig)
    believed = read_rig(tmp_path / "rig.toml")
    values = BASE | FOLDS | ({"magnet_stiffness_N_per_m": 24.0} if kind == "magnetic" else {})
    model = Model(kind, dict.fromkeys(("nominal", "calibrated", "augmented"), values))
    (tmp_path / "model.toml").write_text(model.to_toml())
    found = read_found(tmp_path / "rig.toml", tmp_path / "model.toml", "augmented")
    (tmp_path / "m.fmu").write_bytes(fmu(model_unit("found", found)))
    t = 2e-3 * np.arange(10001)
    command = 6e-3 * np.sin(2 * np.pi * 0.3 * t)
    record = record_of("made", {"t_s": t, found.drive.commanded: command}, believed, driven_only=True)
    model.predict(believed, record)
    began = time.perf_counter()
    here = model.predict(believed, record)[found.drive.measured]
    own_s = time.perf_counter() - began
    played(tmp_path / "m.fmu", command[1:10], 2e-3)
    began = time.perf_counter()
    there = played(tmp_path / "m.fmu", command[1:], 2e-3)[found.drive.measured]
    fmu_s = time.perf_counter() - began
    off = float(np.max(np.abs(there - here)))
    print(
        f"\n{kind}: 20 s played in {fmu_s:.2f} s, prediction {own_s:.2f} s, ratio {fmu_s / own_s:.2f}; off by {off:.1e}"
    )
    assert off < 1e-7
