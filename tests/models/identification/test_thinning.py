"""A long series keeps what a fit needs: its rate, its measured samples, its last record; and it is told."""

import numpy as np
import pytest

from models.identification.settings import SET
from models.identification.thinning import longest_step, said_of, thinned
from models.records.record import Record


def record(name: str, rate_Hz: float, seconds: float, shake_Hz: float = 0.0, every: int = 1) -> Record:
    """A pulled body at 5 mm/s to and fro, with a place in each `every` rows."""
    t = np.arange(0.0, seconds, 1 / rate_Hz)
    x = 5e-3 * np.abs(t % 4 - 2) + 1e-3 * np.sin(2 * np.pi * shake_Hz * t)
    used = {} if every == 1 else {"_used": (np.arange(t.size) % every == 3).astype(float)}
    return Record(name, "pull", {"t_s": t, "position_m": x, "force_N": np.sin(t), **used})


def test_a_short_series_stays_as_it_is() -> None:
    records = [record("a", 500.0, 40.0)]
    assert thinned(records) == (records, [])
    assert said_of(records, records, budget=False) == ""


@pytest.mark.parametrize("shake_Hz", [0.0, 20.0])
def test_a_fast_logger_is_thinned_to_what_its_drive_needs(shake_Hz: float) -> None:
    long = record("a", 50_000.0, 40.0, shake_Hz)
    [short], _ = thinned([long])
    said = said_of([long], [short], budget=False)
    assert "as many as its budget allows" in said_of([long], [short], budget=True)
    rate_Hz = (len(short) - 1) / np.ptp(short["t_s"])
    assert rate_Hz >= max(SET.least_hz, 50 * shake_Hz)
    assert len(short) <= 80_000
    assert f"{len(short)} of {len(long)} rows" in said
    step = 49 if shake_Hz else 100
    assert short.treated == (f"One of {step} rows is used: the drive moves slowly between them.",)
    assert np.isin(short["t_s"], long["t_s"]).all()
    inside = (long["t_s"] >= short["t_s"][0]) & (long["t_s"] <= short["t_s"][-1])
    between = np.interp(long["t_s"], short["t_s"], short["position_m"])
    assert np.max(np.abs(between - long["position_m"])[inside]) < 2e-5


def test_two_million_rows_leave_the_search_as_many_as_twenty_thousand_of_the_same_motion() -> None:
    assert len(thinned([record("a", 50_000.0, 40.0)])[0][0]) == len(record("a", 500.0, 40.0))


def test_rows_with_a_measured_value_are_those_that_stay() -> None:
    long = record("a", 10_000.0, 40.0, every=100)
    [short], _ = thinned([long], 8_000)
    assert short["_used"].sum() == long["_used"].sum()


def test_of_many_records_a_search_uses_those_that_show_most() -> None:
    records = [record(str(k), 200.0, 8.0) for k in range(200)]
    t = records[0]["t_s"]
    fast = records[120].with_column("position_m", 4 * records[120]["position_m"])
    loaded = records[7].with_column("load_N", np.where(t > 4, 0.2, 0.1))
    records[120], records[7], records[64] = fast, loaded, record("64", 200.0, 60.0)
    few, others = thinned(records)
    assert len(few) == SET.most_records
    assert {"120", "7", "64"} <= {one.name for one in few}
    assert sorted(int(one.name) for one in [*few, *others]) == list(range(200))
    assert [int(one.name) for one in few] == sorted(int(one.name) for one in few)
    assert "of 200 records" in said_of(records, few, budget=False)


def test_a_budget_leaves_out_records_where_rows_are_as_few_as_they_may_be() -> None:
    records = [record(str(k), 200.0, 40.0) for k in range(12)]
    few, _ = thinned(records, 8_000)
    assert sum(map(len, few)) <= 24_000
    assert all(longest_step(one) == 2 for one in records)


def test_a_vibrating_drive_keeps_its_rate() -> None:
    assert longest_step(record("a", 1_000.0, 20.0, shake_Hz=20.0)) == 1


def test_means_of_an_accelerometer_are_not_thinned() -> None:
    t = np.arange(0.0, 400.0, 2e-3)
    columns = {"t_s": t, "drive_on": np.zeros(t.size), "position_m": t, "acceleration_m_s2": t}
    assert longest_step(Record("a", "vibro", columns)) == 1
