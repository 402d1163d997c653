"""An axis's place and logged speed: jumps, lag, size and sign are told, and a force that the motion foretells."""

import numpy as np
import pytest
from scipy.signal import lfilter

from models.checks.examine import examine
from models.checks.usable import cleaned
from models.records.record import Record, record_of
from models.rigs.reader import parse_rig

T = np.arange(0.0, 20.0, 1e-3)
X = 0.05 * np.sin(2 * np.pi * 0.5 * T) + 0.02 * np.sin(2 * np.pi * 1.3 * T)
V = np.gradient(X, T)
RIG = parse_rig({"rig": {"kind": "axis"}})


def axis(place: np.ndarray = X, speed: np.ndarray | None = None) -> Record:
    noise = np.random.default_rng(0).standard_normal((3, len(T)))
    force = 3 * np.gradient(V, T) + 4 * np.sign(V) * (1 + np.sqrt(np.abs(V))) + 0.05 * noise[0]
    columns = {"t_s": T, "position_m": place + 1e-6 * noise[1], "force_N": force}
    return record_of("one", columns | ({} if speed is None else {"velocity_m_s": speed + 1e-3 * noise[2]}), RIG)


def told(record: Record) -> dict[str, str]:
    return {finding.id: f"{finding.sentence} {finding.remedy}" for finding in examine(RIG, [record])}


def test_a_speed_that_agrees_is_no_finding() -> None:
    assert told(axis(speed=V)) == {}


@pytest.mark.parametrize(
    ("speed", "said"),
    [
        (lfilter([0.05], [1, -0.95], V), "19. ms late"),
        (0.1 * V, "scale = 10.0"),
        (-V, "sign = -1"),
        (1.1 * V, "1.1 times"),
        (np.interp(T + 0.01, T, V), "10 ms early"),
    ],
)
def test_lag_size_and_sign_of_a_logged_speed_are_told(speed: np.ndarray, said: str) -> None:
    found = told(axis(speed=speed))
    assert list(found) == ["speed_apart"]
    assert all(word in found["speed_apart"] or word == "19." for word in said.split())


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("encoder_mm", 1e3 * np.interp(T - 0.01, T, X), "times position_m and 10 ms late"),
        ("encoder_mm", 1e3 * X, 'position_m = {column = "encoder_mm", unit = "mm"}'),
        ("acceleration_m_s2", -np.gradient(V, T), "times the acceleration of position_m"),
        ("speed_2_m_s", 0.1 * V, "is 0.1 times the speed of position_m"),
        ("reference_position_m", np.interp(T + 0.007, T, X), ""),
        ("load_cell_2_mN", 1e3 + 50 * np.sin(T), ""),
    ],
)
def test_every_column_that_repeats_another_is_told(name: str, values: np.ndarray, said: str) -> None:
    noise = 1e-4 * np.std(values) * np.random.default_rng(1).standard_normal(len(T))
    record = axis()
    found = told(record.with_column(name, values + (0.0 if "column =" in said else noise)))
    assert list(found) == (["column_repeated"] if said else [])
    assert said in found.get("column_repeated", "")


def test_an_encoder_that_slips_is_told_and_taken_out() -> None:
    slips = np.where(T > 7.003, 0.01, 0.0) + np.where(T > 13.007, -0.004, 0.0)
    record = axis(X + slips)
    assert "2 jumps" in told(record)["place_jumps"]
    assert cleaned(record, RIG)["position_m"] == pytest.approx(X, abs=5e-4)


def test_a_slip_may_take_a_few_samples_and_a_signal_that_was_held_is_no_slip() -> None:
    record = axis(X + np.interp(T, [7.0, 7.003], [0.0, 0.02]))
    assert "1 jump" in told(record)["place_jumps"]
    assert cleaned(record, RIG)["position_m"] == pytest.approx(X, abs=5e-4)
    place = axis()["position_m"].copy()
    place[5000:5300] = place[5000]
    record = axis().with_column("position_m", place)
    assert "was lost and held" in told(record)["place_jumps"]
    assert (cleaned(record, RIG)["position_m"] == place).all()


def test_a_fast_sine_has_no_outliers_and_its_force_responds() -> None:
    fast = 1e-3 * np.sin(2 * np.pi * (5 + T) * T)
    force = np.gradient(np.gradient(fast, T), T) * 0.02 + 0.3 * np.random.default_rng(0).standard_normal(len(T))
    assert told(record_of("one", {"t_s": T, "position_m": fast, "force_N": force}, RIG)) == {}


def test_a_force_of_inertia_alone_responds() -> None:
    fast = 2e-4 * np.sin(2 * np.pi * (20 + 0.5 * T) * T)
    force = np.gradient(np.gradient(fast, T), T)
    force += np.std(force) * np.random.default_rng(0).standard_normal(len(T))
    record = record_of("one", {"t_s": T, "position_m": fast, "force_N": force}, RIG)
    assert "no_response" not in told(record)
    deaf = record.with_column("force_N", np.random.default_rng(1).standard_normal(len(T)))
    assert "no_response" in told(deaf)
