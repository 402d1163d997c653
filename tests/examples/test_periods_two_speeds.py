"""The papers' two speeds as one record: what the loop says of them, and that the files hold what was printed."""

import numpy as np

from models.identification import close
from models.records.record import read_record
from models.rigs.reader import read_rig
from models.sets import load_measurement
from tests.places import ROOT

FOLDER = ROOT / "examples" / "periods_two_speeds"


def test_it_is_unknown_and_a_viscous_wall_is_a_part() -> None:
    """As the folder's README tells it."""
    rig = read_rig(FOLDER / "rig.toml")
    record = read_record(FOLDER / "periods.csv", rig)
    slow = record["velocity_m_s"] == 0.5e-3
    np.testing.assert_array_equal(record["period_s"][slow], load_measurement("analytical_table2_periods")["period_s"])
    finding, _ = close(rig, [record], [], lambda stage, share: None)
    assert finding.verdict == "unknown"
    assert [effect.id for effect in finding.effects] == ["wall_viscosity"]
    errors = finding.error["train"]
    assert 4 * finding.noise_floor < errors["augmented"] < 0.8 * errors["calibrated"]
    assert any("the measured period goes from 91.2 ms to 1.16 s (times 12.7)" in said for said in finding.statements)
