"""The vibro sweep: one drive for each verdict, and what is written."""

import json
from pathlib import Path

import numpy as np
import pytest

from plant.drives import TruePull
from plant.rig import Truth
from tests.bench import vibro_sweep as sweep


def test_verdicts() -> None:
    slow = np.asarray(sweep.FREQUENCIES_HZ) < sweep.WALL_HZ
    assert sweep.judge(np.where(slow, 1e-3, 20e-3)) == "holds"
    assert sweep.judge(np.where(slow, -15e-3, 20e-3)) == "fails"
    assert sweep.judge(np.full(slow.size, 1e-4)) == "does not move"


def test_a_spring_alone_obeys_and_an_outer_field_does_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drives = [sweep.SweepDrive(0.25, 150.0, True, False), sweep.SweepDrive(0.12, 62.0, False, False)]
    monkeypatch.setattr(sweep, "sweep_drives", lambda: drives)
    found = sweep.vibro_sweep(tmp_path)
    assert [drive["claim"] for drive in found["drives"]] == ["holds", "fails"]
    assert json.loads((tmp_path / "vibro_sweep.json").read_text()) == found
    page = (tmp_path / "vibro_sweep.html").read_text()
    assert "Plotly.newPlot" in page
    assert 'src="http' not in page


def test_the_stop_makes_slow_drives_move() -> None:
    """The one thing that the claim overlooks on board: a stop rectifies at 10 Hz what a spring alone does not."""
    speed = [abs(sweep.mean_speed(sweep.SweepDrive(0.12, 62.0, True, stop).rig(), 4.0)) for stop in (False, True)]
    assert speed[0] < 0.2e-3
    assert speed[1] > 3 * speed[0]


def test_another_drive_is_refused() -> None:
    with pytest.raises(ValueError, match="must be a vibro drive; got pull"):
        sweep.mean_speed(Truth(TruePull()), 10.0)
