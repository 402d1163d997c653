"""Records of a capsule that an inner mass shakes: what is wired, stamped or scaled wrongly is told, what is right is
not; its noise is told however fast it swings.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from models.checks.estimators import spectral_noise, white_noise
from models.checks.examine import examine
from models.records.record import Record, read_record
from models.rigs.reader import read_rig
from models.rigs.rig import Rig
from tests.plant.series import make_series

Array = NDArray[np.float64]
LATE_S, DRIFT = 0.03, 3e-3


@pytest.fixture(scope="module", params=["vibro", "vibro_plate"])
def shaken(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Rig, Record]:
    """A record of 20 s at 500 Hz and its rig."""
    kind: str = request.param
    folder = make_series(kind, None, 71, tmp_path_factory.mktemp(kind), 20.0)
    rig = read_rig(folder / "rig.toml")
    return rig, read_record(folder / "train_1.csv.gz", rig)


def told(rig: Rig, record: Record) -> dict[str, str]:
    """Findings by id, with their remedies."""
    return {finding.id: f"{finding.severity}: {finding.remedy}" for finding in examine(rig, [record])}


def at(record: Record, t: Array) -> Record:
    """The record with the places that stand at `t` of its own time."""
    return record.with_column("position_m", np.interp(t, record["t_s"], record["position_m"]))


def test_nothing_is_told_of_a_right_record(shaken: tuple[Rig, Record]) -> None:
    assert told(*shaken) == {}


def test_a_turned_sign_stops(shaken: tuple[Rig, Record]) -> None:
    rig, record = shaken
    assert "sign = -1" in told(rig, record.with_column("position_m", -record["position_m"]))["drive_sign"]
    inverted = told(rig, record.with_column("drive_on", 1 - record["drive_on"]))
    assert inverted["drive_sign"].startswith("stops")


@pytest.mark.parametrize("times", [10.0, 0.1])
def test_another_unit_stops(shaken: tuple[Rig, Record], times: float) -> None:
    rig, record = shaken
    assert told(rig, record.with_column("position_m", times * record["position_m"]))["units"].startswith("stops")


def test_a_late_place_is_told_with_its_offset(shaken: tuple[Rig, Record]) -> None:
    rig, record = shaken
    remedy = told(rig, at(record, record["t_s"] - LATE_S))["clock_offset"]
    assert float(remedy.partition("offset_s = ")[2].partition(",")[0]) == pytest.approx(LATE_S, abs=0.01)


def test_a_clock_that_drifts_is_told_with_its_drift(shaken: tuple[Rig, Record]) -> None:
    rig, record = shaken
    remedy = told(rig, at(record, record["t_s"] * (1 - 2 * DRIFT)))["clock_drift"]
    assert float(remedy.partition("drift = ")[2]) == pytest.approx(2 * DRIFT, rel=0.2)


def test_a_switch_is_no_drive(shaken: tuple[Rig, Record]) -> None:
    rig, record = shaken
    assert told(rig, record.with_column("drive_on", np.ones(len(record))))["drive_constant"].startswith("stops")


def test_a_drive_by_its_rated_voltage_is_looked_at_alike(shaken: tuple[Rig, Record]) -> None:
    rig, record = shaken
    assert rig.drive
    volts = replace(rig, drive=rig.drive.model_copy(update={"rated_voltage_V": 12.0}))
    columns = {"t_s": record["t_s"], "coil_voltage_V": 12 * record["drive_on"], "position_m": record["position_m"]}
    assert told(volts, Record("volts", "vibro", columns)) == {}
    turned = columns | {"coil_voltage_V": -columns["coil_voltage_V"]}
    assert "drive_sign" in told(volts, Record("volts", "vibro", turned))


@pytest.mark.parametrize("rate", [50, 100, 250])
def test_swings_that_few_samples_follow_are_no_noise(shaken: tuple[Rig, Record], rate: int) -> None:
    rig, record = shaken
    slow = record.rows(np.arange(len(record)) % (500 // rate) == 0)
    assert "noise_stated" not in told(rig, slow)
    if rate < 250:
        assert spectral_noise(slow["position_m"])[0] < 0.5 * white_noise(slow["position_m"])
    if rate >= 100:
        louder = 4e-4 * np.random.default_rng(1).standard_normal(len(slow))
        assert "noise_stated" in told(rig, slow.with_column("position_m", slow["position_m"] + louder))


@pytest.mark.parametrize("count", [500, 5000])
def test_white_noise_is_told_as_it_is_beside_any_motion(count: int) -> None:
    rng, t = np.random.default_rng(3), np.arange(count)
    for swing in (0.0, 30.0):
        motion = swing * np.sin(2 * np.pi * (0.15 * t + 0.02 * np.sin(0.03 * t)))
        std, flat = spectral_noise(motion + rng.standard_normal(count))
        assert std == pytest.approx(1.0, rel=0.15)
        assert flat
