"""Scenario files, records, anatomy and made-up series."""

import gzip
import tomllib
from pathlib import Path

import numpy as np
import pytest

from hil.app.simulate import write_simulated
from plant.anatomy import Anatomy, along, random_anatomy
from plant.experiments.profile import pulse_width
from plant.experiments.scenario import parse_scenario, parse_truth
from tests.plant.conftest import read_columns
from tests.plant.series import RECORDS, make_series

BASE = """
[scenario]
duration_s = 1.0
seed = 4
[rig]
kind = "{kind}"
[profile]
{profile}
"""
PWM = 'kind = "pwm"\nperiod_s = 0.05\nduty = 0.3'
SINE = 'kind = "sine"\nfrequency_Hz = 1.0\namplitude_V = 4.0'
VIBRO = "[drive]\ninner_mass_kg = 0.002\nspring_stiffness_N_per_m = 60.0\nforce_N = 0.1\n"


@pytest.mark.parametrize(
    ("kind", "profile", "more", "columns"),
    [
        ("pull", 'kind = "random_runs"', "", ["t_s", "position_m", "force_N"]),
        ("magnetic", 'kind = "wander"', "[anatomy]\nseed = 2\n", ["t_s", "carriage_position_m", "position_m"]),
        (
            "coil",
            'kind = "sine"\nfrequency_Hz = 1.0\namplitude_V = 4.0',
            "",
            ["t_s", "coil_current_A", "position_m", "coil_voltage_V"],
        ),
        ("vibro", PWM, VIBRO, ["t_s", "drive_on", "position_m"]),
        (
            "vibro",
            PWM,
            VIBRO + "[accelerometer]\nrate_Hz = 500\n",
            ["t_s", "drive_on", "position_m", "acceleration_m_s2"],
        ),
        (
            "magnetic",
            'kind = "wander"',
            "[accelerometer]\n[load_cell]\nstd_N = 0.002\n",
            ["t_s", "carriage_position_m", "position_m", "acceleration_m_s2", "drive_force_N"],
        ),
        (
            "vibro",
            PWM,
            VIBRO + "[drive.coil]\ngain_N_per_A = 0.3\n",
            ["t_s", "coil_voltage_V", "position_m", "coil_current_A"],
        ),
    ],
)
def test_simulate_writes_the_record_of_the_kind(
    kind: str, profile: str, more: str, columns: list[str], tmp_path: Path
) -> None:
    file = tmp_path / "scenario.toml"
    file.write_text(BASE.format(kind=kind, profile=profile) + more)
    for name in ("one.csv", "two.csv.gz"):
        write_simulated(file, tmp_path / name)
    record = read_columns(tmp_path / "one.csv")
    assert list(record) == columns
    assert record["t_s"].size == 500
    assert np.diff(record["t_s"]) == pytest.approx(2e-3)
    assert all(np.all(np.isfinite(column)) for column in record.values())
    assert gzip.decompress((tmp_path / "two.csv.gz").read_bytes()) == (tmp_path / "one.csv").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.csv", "scenario.toml", "two.csv.gz"]


def test_drive_on_keeps_every_edge(tmp_path: Path) -> None:
    file = tmp_path / "scenario.toml"
    file.write_text(BASE.format(kind="vibro", profile='kind = "pwm"\nperiod_s = 0.0371\nduty = 0.313') + VIBRO)
    write_simulated(file, tmp_path / "out.csv")
    on = read_columns(tmp_path / "out.csv")["drive_on"]
    assert np.min(on) >= 0
    assert np.max(on) <= 1
    assert np.sum(on[1:]) * 2e-3 == pytest.approx(
        26 * 0.0371 * 0.313 + min(0.998 - 26 * 0.0371, 0.313 * 0.0371), abs=1e-5
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "magnetic"', 'kind = "magnetc"', "rig.kind must be one of .*did you mean 'magnetic'"),
        ("[profile]", "[profil]", "did you mean 'profile'"),
        ("seed = 4", "sed = 4", r"keys of \[scenario\] must be among .*did you mean 'seed'"),
        ("seed = 4", 'seed = "4"', "scenario.seed must be an integer"),
        ("duration_s = 1.0", "duration_s = 1e9", "duration_s must be 2e-05 to 1000 s"),
        ("duration_s = 1.0", "duration_s = nan", "duration_s must be a finite number"),
        ("[profile]", "[capsule]\nmass_kg = -1.0\n[profile]", "capsule.mass_kg must be 1e-05 to 0.5 kg; got -1"),
        ("[profile]", "[effects.spring_damping]\n[profile]", "must be for it; got 'spring_damping'"),
        ("[profile]", "[surface]\nkind = 'ice'\n[profile]", "surface.kind must be one of gut, plate, air; got 'ice'"),
        ("[profile]", "[sensor]\nrate_hz = 5.0\n[profile]", "did you mean 'rate_Hz'"),
        ("[profile]", "[load_cell]\nrate_Hz = 0.0\n[profile]", "rate_Hz positive .*; got a magnetic rig and 0"),
        (
            'kind = "magnetic"\n[profile]',
            'kind = "pull"\n[load_cell]\n[profile]',
            "kind magnetic, coil, .*got a pull rig",
        ),
    ],
)
def test_a_bad_scenario_is_refused_in_one_sentence(old: str, new: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "scenario.toml"
    file.write_text(BASE.format(kind="magnetic", profile='kind = "wander"').replace(old, new))
    with pytest.raises(ValueError, match=message):
        write_simulated(file, tmp_path / "out.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["scenario.toml"]


def test_simulate_refuses_another_file_type(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"must end in \.csv"):
        write_simulated(tmp_path / "scenario.toml", tmp_path / "out.parquet")


def test_the_same_seed_is_the_same_series(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        make_series("pull", "fold_periodic", 5, tmp_path / folder, 5.0)
    for name in (*(f"{record}.csv.gz" for record in RECORDS), "rig.toml", "answer.toml"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_a_series_pairs_with_the_one_without_effect(tmp_path: Path) -> None:
    folders = [make_series("magnetic", effect, 5, tmp_path / str(effect), 5.0) for effect in (None, "coupling_fade")]
    answers = [tomllib.loads((folder / "answer.toml").read_text()) for folder in folders]
    records = [read_columns(folder / "holdout.csv.gz") for folder in folders]
    assert [answer["effect"] for answer in answers] == ["none", "coupling_fade"]
    assert answers[0]["hoop_stress_factor"] == answers[1]["hoop_stress_factor"]
    assert np.array_equal(records[0]["carriage_position_m"], records[1]["carriage_position_m"])
    assert not np.array_equal(records[0]["position_m"], records[1]["position_m"])
    assert 0.85 <= answers[0]["hoop_stress_factor"] <= 1.15
    rig = tomllib.loads((folders[0] / "rig.toml").read_text())
    assert rig["rig"] == {"kind": "magnetic", "magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02}


def test_a_series_refuses_what_the_drive_cannot_have(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="got 'string_compliance', which is for pull"):
        make_series("magnetic", "string_compliance", 0, tmp_path)


def test_anatomies() -> None:
    assert random_anatomy(3) == random_anatomy(3)
    assert random_anatomy(3) != random_anatomy(4)
    assert min(random_anatomy(5).level) > 0
    ramp = along([0.0, 0.01], [1.0, 2.0])
    assert ramp.at(np.array([-1.0, 0.005, 1.0])) == pytest.approx([1.0, 1.5, 2.0])
    assert ramp.times(ramp).at(np.array([0.01])) == pytest.approx(4.0, rel=0.03)
    with pytest.raises(ValueError, match="places_m must increase"):
        along([0.0, 0.0], [1.0, 1.0])
    with pytest.raises(ValueError, match="level must be positive"):
        Anatomy((1.0, -1.0))


@pytest.mark.parametrize(("period_s", "duty"), [(0.05, 0.3), (0.0371, 0.313), (1e-5, 0.5), (0.01, 0.0), (0.01, 1.0)])
def test_pwm_has_its_duty(period_s: float, duty: float) -> None:
    share = pulse_width(period_s, duty, 100 * period_s, 20e-6)
    assert np.min(share) >= -1e-9
    assert np.max(share) <= 1 + 1e-9
    assert np.mean(share[: round(100 * period_s / 20e-6)]) == pytest.approx(duty, abs=1e-3)


def test_a_scenario_reads_a_record_as_its_profile(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text("t_s,carriage_position_m\n0,0\n1,0.01\n")
    raw = {"rig": {"kind": "magnetic"}, "scenario": {"duration_s": 1.0}}
    raw["profile"] = {"kind": "record", "path": "drive.csv", "column": "carriage_position_m"}
    values = parse_scenario(raw, tmp_path).profile.values(1.0, 0.25, np.random.default_rng())
    assert values == pytest.approx([0, 0.0025, 0.005, 0.0075, 0.01])


def test_tissue_of_a_scenario_has_regime_and_lumen() -> None:
    tissue = {"regime": "blend", "lumen_diameter_m": 9e-3}
    _, _, rig = parse_truth({"rig": {"kind": "magnetic"}, "tissue": tissue})
    assert rig.tissue.regime == "blend"
    assert rig.tissue.contact_angle_deg == pytest.approx(46.2, abs=0.02)
    with pytest.raises(ValueError, match=r"tissue\.regime must be one of low, high, blend; got 'fast'"):
        parse_truth({"rig": {"kind": "magnetic"}, "tissue": {"regime": "fast"}})
