"""A pause of a record counts in no fit, nor does the travel after it until a body has settled."""

from pathlib import Path

import numpy as np
import pytest

from models.checks.examine import examine
from models.checks.usable import cleaned, used
from models.records.record import read_record, record_of
from models.rigs.reader import read_rig
from models.rigs.rig import Rig
from tests.plant.series import make_series

T = 0.005 * np.arange(4000)
THERE = (T < 8) | (T > 11)
DRIVE = 0.02 * np.sin(0.5 * T)


@pytest.mark.parametrize(("kind", "drive", "measured", "settled"), [
    ("magnetic", "carriage_position_m", "position_m", 6e-3),
    ("pull", "position_m", "force_N", 2e-3),
])  # fmt: skip
def test_a_pause_and_the_travel_after_it_do_not_count(kind: str, drive: str, measured: str, settled: float) -> None:
    columns = {"t_s": T, drive: DRIVE, measured: np.cos(T)}
    record = record_of("one", {name: values[THERE] for name, values in columns.items()}, Rig(kind))
    clean = cleaned(record, Rig(kind))
    t, count = clean["t_s"], used(clean)
    assert np.max(np.diff(t)) < 0.011
    travelled = np.abs(clean[drive] - clean[drive][np.searchsorted(t, 11.0)])
    assert not count[(t > 8.001) & (t < 10.999)].any()
    assert not count[(t > 11) & (t < 12) & (travelled < 0.9 * settled)].any()
    assert count[t > 14].mean() > 0.9
    assert any("pause" in said for said in clean.treated or ())


def test_a_pause_is_no_jump() -> None:
    columns = {"t_s": T, "carriage_position_m": DRIVE, "position_m": DRIVE + 1e-5 * np.cos(9 * T)}
    record = record_of("one", {name: values[THERE] for name, values in columns.items()}, Rig("magnetic"))
    assert "pause" in {one.id for one in examine(Rig("magnetic"), [record])}
    assert "place_jumps" not in {one.id for one in examine(Rig("magnetic"), [record])}


def test_a_pause_is_no_drift_of_clocks(tmp_path: Path) -> None:
    out = make_series("magnetic", None, 3, tmp_path, 20.0)
    rig = read_rig(out / "rig.toml")
    record = read_record(out / "train_1.csv.gz", rig)
    assert examine(rig, [record]) == ()
    there = (record["t_s"] < 8) | (record["t_s"] > 13)
    assert {one.id for one in examine(rig, [record.rows(there)])} == {"pause"}


def test_where_nothing_brings_a_body_back_the_longest_stretch_is_used() -> None:
    columns = {"t_s": T, "coil_current_A": np.sin(T), "position_m": np.cos(T)}
    record = record_of("one", {name: values[THERE] for name, values in columns.items()}, Rig("coil"))
    clean = cleaned(record, Rig("coil"))
    assert (clean["t_s"][0], clean["t_s"][-1]) == (T[THERE][T[THERE] > 10][0], T[-1])
    assert any("longest stretch" in said for said in clean.treated or ())
