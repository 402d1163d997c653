"""A long series keeps what a fit needs: its rate, its measured samples, its last record; and it is told."""

import numpy as np
import pytest

from models.records.record import Record
from models.records.thinning import LEAST_HZ, longest_step, thinned


def record(name: str, rate_Hz: float, seconds: float, shake_Hz: float = 0.0, every: int = 1) -> Record:
    """A pulled body at 5 mm/s to and fro, with a place in each `every` rows."""
    t = np.arange(0.0, seconds, 1 / rate_Hz)
    x = 5e-3 * np.abs(t % 4 - 2) + 1e-3 * np.sin(2 * np.pi * shake_Hz * t)
    used = {} if every == 1 else {"_used": (np.arange(t.size) % every == 3).astype(float)}
    return Record(name, "pull", {"t_s": t, "position_m": x, "force_N": np.sin(t), **used})


def test_a_short_series_stays_as_it_is() -> None:
    records = [record("a", 500.0, 40.0)]
    assert thinned(records) == (records, "")


@pytest.mark.parametrize("shake_Hz", [0.0, 20.0])
def test_a_fast_logger_is_thinned_to_what_its_drive_needs(shake_Hz: float) -> None:
    long = record("a", 50_000.0, 40.0, shake_Hz)
    [short], said = thinned([long])
    rate_Hz = (len(short) - 1) / np.ptp(short["t_s"])
    assert rate_Hz >= max(LEAST_HZ, 50 * shake_Hz)
    assert len(short) <= 80_000
    assert f"{len(short)} of {len(long)} rows" in said
    assert short.treated == ("One of 25 rows is used: the drive moves slowly between them.",)
    assert np.isin(short["t_s"], long["t_s"]).all()
    inside = long["t_s"] >= short["t_s"][0]
    between = np.interp(long["t_s"], short["t_s"], short["position_m"])
    assert np.max(np.abs(between - long["position_m"])[inside]) < 2e-5


def test_rows_with_a_measured_value_are_those_that_stay() -> None:
    long = record("a", 10_000.0, 40.0, every=100)
    [short], _ = thinned([long], 8_000)
    assert short["_used"].sum() == long["_used"].sum()


def test_many_records_are_chosen_evenly_and_the_last_stays() -> None:
    records = [record(str(k), 200.0, 40.0) for k in range(60)]
    few, said = thinned(records, 13_000)
    assert few[-1].name == "59"
    assert sum(map(len, few)) <= 40_000
    assert "of 60 records, evenly chosen" in said
    assert all(longest_step(one) == 2 for one in records)
    steps = np.diff([int(one.name) for one in few])
    assert np.ptp(steps) <= 1


def test_a_vibrating_drive_keeps_its_rate() -> None:
    assert longest_step(record("a", 1_000.0, 20.0, shake_Hz=20.0)) == 1


def test_means_of_an_accelerometer_are_not_thinned() -> None:
    t = np.arange(0.0, 400.0, 2e-3)
    columns = {"t_s": t, "drive_on": np.zeros(t.size), "position_m": t, "acceleration_m_s2": t}
    assert longest_step(Record("a", "vibro", columns)) == 1
