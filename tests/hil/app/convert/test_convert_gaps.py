"""`capsule convert` writes the rows that close-loop reads: nothing over a gap, and it says what it left out."""

from pathlib import Path

import numpy as np
import pytest

from hil.app.main import run
from hil.formats.channels import Channel, Heading
from hil.formats.mcap_file import write
from hil.log.rig_record import read_rig_record
from models.records.record import as_measured
from models.rigs.reader import read_rig
from tests.rig_texts import GUT

T = 0.005 * np.arange(3000)
RIG = f"""{GUT}
[rig]
kind = "magnetic"
magnet_stiffness_N_per_m = 25.0
magnet_range_m = 0.02
[columns]
carriage_position_m = "carriage/x"
position_m = "capsule/x"
"""


def test_converted_rows_are_those_that_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mcap")
    rig, log, out = (tmp_path / name for name in ("rig.toml", "a.mcap", "a.csv"))
    rig.write_text(RIG)
    there, late = (T < 6) | (T > 8), T + 0.0013
    late[500] += 12.0
    channels = [
        Channel(Heading("carriage/x", "m", "carriage", clocked=True), 0.01 * np.sin(T[there]), T[there]),
        Channel(Heading("capsule/x", "m", "capsule", clocked=True), 0.01 * np.sin(late - 0.1), late),
    ]
    write(log, channels)
    assert run(["convert", str(log), str(out), "--rig", str(rig)]) == 0
    said = capsys.readouterr().err
    assert "carriage_position_m has no samples there, for up to 2" in said
    assert "1 of 3000 stamps of position_m do not fit" in said
    table, again = tmp_path / "a.parquet", tmp_path / "b.csv"
    assert run(["convert", str(log), str(table)]) == 0
    assert "1 of 3000 stamps of capsule/x do not fit" in capsys.readouterr().err
    assert run(["convert", str(table), str(again), "--rig", str(rig)]) == 0
    assert again.read_bytes() == out.read_bytes()
    belief = read_rig(rig)
    wanted, found = (as_measured(read_rig_record(path, belief)) for path in (log, out))
    assert wanted.keys() == found.keys()
    for name, values in wanted.items():
        assert found[name] == pytest.approx(values, abs=1e-9, nan_ok=True)
    assert not ((found["t_s"] > 6.01) & (found["t_s"] < 7.99)).any()
