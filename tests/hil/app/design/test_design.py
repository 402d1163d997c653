"""`capsule design`: numbers as one JSON object, plots in one page, one sentence for a rig that has no linear design."""

import json
import math
import re
from functools import partial
from pathlib import Path

import pytest

from hil.app.design.design import study_of
from hil.app.main import run
from tests.conftest import RIG

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

PULL = re.sub(r"magnet_.*\n", "", RIG.replace('"magnetic"', '"pull"'))


def test_design_prints_numbers_and_draws(rig_text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(rig_text)
    assert run(["design", str(rig), "--json", "--out", str(tmp_path / "out")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["controller"] for row in found["margins"]} == {"pid", "lqr"}
    assert all(row["stable"] and row["phase_deg"] > 30 for row in found["margins"])
    assert found["plants"]["stick"]["poles_1_per_s"][0][0] < found["plants"]["slip"]["poles_1_per_s"][0][0] < 0
    assert not found["cycles"]["pid"]["hold"]["hunts"]
    assert not any(cycle["stable"] for cycle in found["harmonic_balance"]["pid"])
    page = (tmp_path / "out" / "design.html").read_text(encoding="utf-8")
    assert "Nyquist" in page
    assert "Harmonic balance" in page
    assert 'src="http' not in page


def test_an_inner_mass_has_its_resonance_its_gears_and_a_slow_loop_that_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hil.app.design.design.study_of", partial(study_of, optimise=False))
    rig = tmp_path / "rig.toml"
    rig.write_text(VIBRO)
    assert run(["design", str(rig), "--json", "--out", str(tmp_path / "out")]) == 0
    found = json.loads(capsys.readouterr().out)
    held = math.sqrt(256.23 / 0.074) / (2 * math.pi)
    assert found["resonance"]["held_Hz"] == pytest.approx(held)
    assert found["resonance"]["free_Hz"] == pytest.approx(held * math.sqrt(1 + 0.074 / 0.193))
    assert found["resonance"]["contact_s"] is None
    low, high = found["reach_m_s"]
    assert low < -2e-3 < 2e-3 < high
    assert {one["impact"] for one in found["ways"]} == {"none"}
    own = [one for one in found["ways"] if one["shape"] == "map"]
    assert all(one["speed_m_s"] == pytest.approx(one["commanded_m_s"], rel=0.15) for one in own)
    assert all(one["stable"] and one["gain"] > 2 and one["phase_deg"] > 30 for one in found["slow_loops"])
    assert "Gears" in (tmp_path / "out" / "design.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        (PULL, (), "must be of a kind whose capsule is free"),
        (VIBRO, ("--stage", "best"), "--stage must be one of"),
        (VIBRO, ("--delay", "900"), "--delay must lie in [0, 200] ms; got 900"),
        (RIG, ("--speed", "500"), "--speed must lie in [0.01, 100] mm/s; got 500"),
    ],
)
def test_design_says_what_it_cannot_do(
    text: str, options: tuple[str, ...], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(text)
    assert run(["design", str(rig), *options]) == 2
    assert words in capsys.readouterr().err


def test_a_coil_with_a_resistance_is_designed_for_voltage_and_gains_carry_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As track drives it. Without --out nothing is drawn, which the output says, as it says that other gains run."""
    rig = tmp_path / "rig.toml"
    coil = re.sub(r"magnet_.*\n", "", RIG.replace('"magnetic"', '"coil"')).replace(
        "[rig]\n", "[rig]\nforce_constant_N_per_A = 0.5\n"
    )
    winding = "coil_resistance_Ohm = 10.0\ncoil_inductance_H = 0.01\n"
    rig.write_text(coil.replace("[rig]\n", f"[rig]\n{winding}"))
    assert run(["design", str(rig)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"K_p [\d.e+]+ V/m, K_i [\d.e+]+ V/\(m s\), K_d [\d.e+]+ V s/m", said)
    assert "k_p 100 N/m" in said
    assert "--out DIR" in said
