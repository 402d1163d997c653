"""The base model's trajectories from a separate implementation: pull, magnetic, constant speed."""

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt

from plant import layout as at
from plant.drives import TrueMagnet, TruePull
from plant.experiments.profile import ConstantSpeed
from plant.rig import STEP_S, Plant, Truth
from plant.tables import Floats
from tests.plant.conftest import read_columns

EVERY = 50


def low_passed(y: Floats, rate_Hz: float = 1000.0) -> Floats:
    b, a = butter(2, 2.0, fs=rate_Hz)
    return np.asarray(filtfilt(b, a, y))


def test_pull_force_follows_the_reference(shared: Path) -> None:
    reference = read_columns(shared / "reference" / "pull.csv")
    t = STEP_S * np.arange(EVERY * (reference["t_s"].size - 1) + 2)
    x = np.interp(
        t, reference["t_s"], reference["position_m"]
    )  # the reference moved in straight lines between its samples
    rows = Plant(Truth(TruePull())).advance(
        np.append(x[1:], x[-1]), EVERY
    )  # its force belongs to the speed it goes on with
    error = rows[:, at.O_FORCE] - reference["force_N"]
    assert np.max(np.abs(low_passed(error))) < 0.5e-3
    assert np.median(np.abs(error)) < 0.1e-3


def test_magnetic_capsule_follows_the_reference(shared: Path) -> None:
    reference = read_columns(shared / "reference" / "magnetic.csv")
    t = STEP_S * np.arange(EVERY * (reference["t_s"].size - 1) + 2)
    carriage = CubicSpline(reference["t_s"], reference["carriage_position_m"])(t)
    rows = Plant(Truth(TrueMagnet(25.0, 0.02))).advance(carriage, EVERY)
    assert np.max(np.abs(low_passed(rows[:, at.O_X] - reference["position_m"]))) < 20e-6
    assert np.max(np.abs(low_passed(rows[:, at.O_FORCE] - reference["force_N"]))) < 1e-3


def test_teeth_do_not_depend_on_the_step() -> None:
    def teeth(step_s: float) -> Floats:
        drive = ConstantSpeed(0.014).values(1.5, step_s, np.random.default_rng())
        rows = Plant(Truth(TruePull(), step_s=step_s)).advance(drive)
        return rows[np.flatnonzero(np.diff(np.sign(np.diff(rows[:, at.O_U]))) < 0) + 1, at.O_T]

    coarse, fine = teeth(STEP_S), teeth(STEP_S / 10)
    assert coarse.size == fine.size > 20
    assert np.max(np.abs(coarse - fine)) < STEP_S  # late by a step a tooth they would be off by twenty


def test_constant_speed_gives_the_reference_saw_tooth(shared: Path) -> None:
    reference = read_columns(shared / "reference" / "constant_speed.csv")
    for k, speed in enumerate(reference["speed_m_s"]):
        duration = 12 * reference["period_s"][k] + 0.3
        rows = Plant(Truth(TruePull())).advance(ConstantSpeed(speed).values(duration, STEP_S, np.random.default_rng()))
        rows = rows[rows[:, at.O_T] > 0.3]
        force, slips = rows[:, at.O_FORCE], np.flatnonzero(np.diff(np.sign(np.diff(rows[:, at.O_U]))) < 0)
        periods = np.diff(rows[slips, at.O_T])
        assert np.mean(periods) == pytest.approx(reference["period_s"][k], rel=2e-3)
        whole = slice(int(slips[0]), int(slips[-1]))
        assert np.mean(force[whole]) == pytest.approx(reference["mean_force_N"][k], rel=2e-3)
        assert np.min(force[whole]) == pytest.approx(reference["valley_force_N"][k], rel=1e-3)
        assert np.max(force[whole]) == pytest.approx(reference["peak_force_N"][k], rel=1e-3)


def test_chunks_give_what_one_run_gives() -> None:
    drive = 0.01 * np.sin(STEP_S * 3 * np.arange(100_001))
    whole = Plant(Truth(TrueMagnet())).advance(drive, 7)
    plant = Plant(Truth(TrueMagnet()))
    parts = [plant.advance(drive[a : b + 1], 7) for a, b in ((0, 13), (13, 60_000), (60_000, 100_000))]
    assert np.array_equal(whole, np.concatenate(parts))
    assert plant.time == pytest.approx(2.0)
