"""`capsule effects`, and an effect of one's own from record to controller."""

import json
from pathlib import Path

import pytest

from hil.app.main import run
from models.effects import CATALOGUE, EFFECTS, Catalogue
from models.effects.conformance import CHECKS
from models.identification.model import Model, own_effects_of
from models.theta import Theta
from tests.places import ROOT, SCENARIOS

BUMP = str(ROOT / "examples" / "own_effect" / "soft_bump.py")


def said(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    """What a command prints with --json."""
    assert run([*arguments, "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def test_the_catalogue_is_listed_whole(capsys: pytest.CaptureFixture[str]) -> None:
    listed = said(capsys, "effects")["effects"]
    assert isinstance(listed, list)
    assert [row["id"] for row in listed] == [effect.id for effect in EFFECTS]
    for row in listed:
        assert all(row[key] for key in ("summary", "equation", "kinds", "parameters", "separated_by"))
        assert set(row["confounders"]) <= set(CATALOGUE)
    assert run(["effects"]) == 0
    assert "stenosis" in capsys.readouterr().out
    more = said(capsys, "effects", "--effects", BUMP)["effects"]
    assert isinstance(more, list)
    assert more[-1]["id"] == "soft_bump"


def test_an_own_file_is_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "effects", "check", BUMP)["effects"] == [
        {"id": "soft_bump", "checks": list(CHECKS), "passed": True}
    ]
    bad = tmp_path / "bad.py"
    bad.write_text("x = 1\n")
    assert run(["effects", "check", str(bad)]) == 2
    assert "bad.py: file must have a subclass" in capsys.readouterr().err
    assert run(["effects", "check"]) == 2
    assert run(["effects", "chek", str(bad)]) == 2


def test_a_model_with_an_own_effect_leads_and_replays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.toml"
    base = Theta({"hoop_stress_factor": 1.0, "friction_coefficient": 0.082, "magnet_stiffness_N_per_m": 25.0})
    stages = {
        "nominal": base,
        "calibrated": base,
        "augmented": base.with_("soft_bump", {"force_N": 0.02, "place_m": 3e-3}),
    }
    model.write_text(
        Model("magnetic", stages, own_effects=own_effects_of(stages, Catalogue.read([Path(BUMP)]))).to_toml()
    )
    scenario = tmp_path / "short.toml"
    text = (SCENARIOS / "sil_magnetic_hidden_folds.toml").read_text()
    scenario.write_text(text.replace("duration_s = 20.0", "duration_s = 2.0"))
    asked = ["sil", str(scenario), "--controller", "feedforward", "--model", str(model), "--out", str(tmp_path / "out")]
    assert run(asked) == 2
    assert "--effects soft_bump.py" in capsys.readouterr().err
    assert said(capsys, *asked, "--effects", BUMP)["model"] == "augmented"
    log = str(tmp_path / "out" / "frames.blf")
    assert run(["replay", log]) == 2
    assert "soft_bump" in capsys.readouterr().err
    assert run(["replay", log, "--effects", BUMP]) == 0
