"""`capsule design`: numbers as one JSON object, plots in one page, one sentence for a rig that has no linear design."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hil.app.main import run

VIBRO = """[drive]
inner_mass_kg = 0.074
spring_stiffness_N_per_m = 256.23
force_N = 1.25
reaction_on_body = true
[capsule]
mass_kg = 0.193
[surface]
kind = "plate"
friction_coefficient = 0.29
[rig]
kind = "vibro"
"""


def test_design_prints_numbers_and_draws(rig_text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(rig_text)
    assert run(["design", str(rig), "--json", "--out", str(tmp_path / "out")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["controller"] for row in found["margins"]} == {"pid", "lqr"}
    assert all(row["stable"] and row["phase_deg"] > 30 for row in found["margins"])
    assert found["plants"]["stick"]["poles_1_per_s"][0][0] < found["plants"]["slip"]["poles_1_per_s"][0][0] < 0
    assert not found["cycles"]["pid"]["hold"]["hunts"]
    page = (tmp_path / "out" / "design.html").read_text(encoding="utf-8")
    assert "Nyquist" in page
    assert 'src="http' not in page


@pytest.mark.parametrize(
    ("options", "words"), [((), "must be magnetic or coil"), (("--stage", "best"), "--stage must be one of")]
)
def test_design_says_what_it_cannot_do(
    options: tuple[str, ...], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(VIBRO)
    assert run(["design", str(rig), *options]) == 2
    assert words in capsys.readouterr().err
