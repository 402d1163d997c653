"""What `capsule track` refuses: one sentence with the file's name, before anything runs."""

from pathlib import Path

import pytest

from hil.app.main import run
from tests.hil.app.track.track_texts import SHORT


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ("[checks]\nrms_mm = 1\n", "did you mean 'rmse_mm'"),
        ("[checks.mpcc]\nrmse_mm = 1\n", "did you mean 'mpc'"),
        ("[checks.vibro]\nrmse_mm = 1\n", "table of [checks] for a magnetic rig must be one of"),
        ("[checks]\nrmse_mm = -1\n", "checks.rmse_mm must be zero or more"),
        ("[checks]\nrmse_mm = 'low'\n", "checks.rmse_mm must be a finite number"),
        ("[checks]\nrecovered_within_s = 1\n", "must stand with recovered_mm"),
        ("[checks]\nrecovered_within_s = 1\nrecovered_mm = 0.2\n", "must have the end of a drop-out"),
        ("[checks]\nsettled_within_s = 1\nsettled_mm = 0.2\n", "must have a reference that comes to rest"),
        ("[checks]\ndrift_mm = 0.1\n", "must have a reference at rest"),
        ("[checks]\nspeed_error_percent = 10\n", "at one speed for over 3 s"),
    ],
)
def test_checks_that_cannot_be_judged_are_refused(
    short: Path, more: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Status 2, the file's name and what would be right."""
    short.write_text(SHORT + more, encoding="utf-8")
    assert run(["track", str(short)]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert str(short) in said


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "duration_s = 2.0",
            "duration_s = 0.8\n[control]\njudged_from_s = 0.7999",
            "be at most 0.7996 s in a run of 0.8 s",
        ),
        ("duration_s = 2.0", "duration_s = 0.0001", "duration_s must be a tick of 0.001 s or more"),
        ("duration_s = 2.0", "duration_s = 2.0\nseed = -1", "scenario.seed must be zero or more"),
        ("[reference]", "[anatomy]\nseed = -3\n[reference]", "anatomy.seed must be zero or more"),
        (
            "[reference]",
            "magnet_stiffness_N_per_m = -3.0\n[reference]",
            "rig.magnet_stiffness_N_per_m must be at least 1e-12",
        ),
        (
            "[reference]",
            "[tissue]\nfriction_coefficient = -1.0\n[reference]",
            "tissue.friction_coefficient must be 0 to 10; got -1",
        ),
        ("[reference]", "[bus]\n[reference]", "got [bus], which `capsule sil` reads"),
        ("[reference]", "[effects.stenosis]\nexces = 1.0\n[reference]", "numbers of stenosis must be among"),
        ("[reference]", "[capsule]\nradius_m = -1.0\n[reference]", "capsule.radius_m must be 0.0001 to 0.1 m; got -1"),
        (
            "[reference]",
            "[control]\ncontroller = 'vibro'\n[reference]",
            "of a magnetic rig must be one of pid,",
        ),
        (
            "[reference]",
            "[surface]\nkind = 'air'\n[reference]",
            "surface.kind must be 'gut' or 'plate' for a rig to be controlled",
        ),
        (
            "[reference]",
            "[belief.noise]\nposition_std_m = 2e-3\n[reference]",
            "belief must have no table [belief.noise]",
        ),
        ("[reference]", "[localisation]\ngaps_s = [-3.0, -1.0]\n[reference]", "localisation.gaps_s must be pairs"),
        ("[reference]", "[localisation]\nrate_Hz = 1e-9\n[reference]", "localisation.rate_Hz must lie in [0.5, 5000]"),
        ("speed_mm_s = 2.0", "speed_mm_s = 1e9", "reference.speed_mm_s must lie in [-1e+06, 1e+06]"),
        ("speed_mm_s = 2.0", "speed_mm_s = 400.0", "no faster than limits.speed_m_s, 300 mm/s"),
        ("speed_mm_s = 2.0", "speed_mm_s = 2.0\nstart_s = -5.0", "reference.start_s must lie"),
        ("[reference]", "[limits]\ntravel_m = 0.002\n[reference]", "reference must stay within limits.travel_m, 2 mm"),
        (
            '"ramp"\nspeed_mm_s = 2.0',
            '"sine"\namplitude_mm = 1e9\nfrequency_Hz = 0.01',
            "reference.amplitude_mm must lie in [-1e+06, 1e+06]",
        ),
        ('kind = "ramp"', 'kind = "steps"\npositions_mm = []', "reference.positions_mm must be one position or more"),
        (
            'kind = "ramp"',
            'kind = "steps"\npositions_mm = [10.0]',
            "reference must arrive within the run of 2 s; got 5.5 s",
        ),
        (
            'kind = "ramp"',
            'kind = "hold"\nposition_mm = -10.0',
            "reference must arrive within the run of 2 s; got 5.5 s",
        ),
    ],
)
def test_what_cannot_be_is_said_of_the_file_at_loading(
    short: Path, old: str, new: str, sentence: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """One line on standard error, with the file's name."""
    short.write_text(SHORT.replace(old, new), encoding="utf-8")
    assert run(["track", str(short)]) == 2
    said = capfd.readouterr().err
    assert sentence in said
    assert said.startswith(f"capsule: {short}: ")
    assert said.count("\n") == 1


def test_an_empty_name_is_no_controller(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It does not mean the scenario's."""
    assert run(["track", str(short), "--controller", ""]) == 2
    assert "controller must be one of" in capsys.readouterr().err
