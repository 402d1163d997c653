"""Controllers from a user's file: used by name, held by the limits, stepped in for; what is refused, in a sentence."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller.registry import CONTROLLERS, leads, use_controllers
from hil.app.main import run
from tests.places import ROOT, SCENARIOS

EXAMPLE = ROOT / "examples" / "own_controller" / "lead.py"
TEXT = EXAMPLE.read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def _none_left() -> Iterator[None]:
    yield
    use_controllers([])


def own_file(folder: Path, old: str, new: str) -> Path:
    """The example with `old` replaced."""
    assert old in TEXT
    path = folder / "mine.py"
    path.write_text(TEXT.replace(old, new), encoding="utf-8")
    return path


def tracked(capsys: pytest.CaptureFixture[str], folder: Path, file: Path, status: int = 0) -> dict[str, object]:
    """What `capsule track` says of two seconds under it, ended with this `status`."""
    text = (SCENARIOS / "track_magnetic_ramp.toml").read_text(encoding="utf-8")
    scenario = folder / "ramp.toml"
    head = text[: text.index("[checks")]
    scenario.write_text(head.replace("duration_s = 20.0", "duration_s = 4.0"), encoding="utf-8")
    asked = ["track", str(scenario), "--controllers", str(file), "--controller", "lead", "--json"]
    assert run(asked) == status
    return dict(json.loads(capsys.readouterr().out))


def test_it_leads_by_its_name_until_it_is_no_longer_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = tracked(capsys, tmp_path, EXAMPLE)
    assert found["controller"] == "lead"
    assert found["hard_violations"] == 0
    assert isinstance(found["tracking_rmse_m"], float)
    assert found["tracking_rmse_m"] < 2e-3
    assert leads("lead") == ("magnetic",)
    use_controllers([])
    assert "lead" not in CONTROLLERS


def test_a_pid_steps_in_for_one_that_raises(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = tracked(
        capsys, tmp_path, own_file(tmp_path, "        ahead = ", "        raise KeyError\n        ahead = "), status=1
    )
    assert str(found["ended"]).startswith("lead must lead 99 % of the ticks")
    assert found["hard_violations"] == 0
    assert isinstance(found["tracking_rmse_m"], float)
    assert found["tracking_rmse_m"] < 2e-3


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("class Lead(Controller)", "class Lead", "must have a subclass of controller.signals.Controller"),
        ('name = "lead"', 'name = "mpc"', "must be one that is free; got 'mpc'"),
        ('kinds = ("magnetic",)', 'kinds = ("pull",)', "kinds must be some of magnetic, coil, vibro"),
        ("model: ControlModel, envelope: Envelope", "model: ControlModel", "must be made from (model, envelope)"),
        ("estimate: Estimate, reference: Reference) -> Action", "estimate: Estimate) -> Action", "act must take"),
    ],
)
def test_what_cannot_be_used_is_refused_in_a_sentence(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=r"mine\.py") as refused:
        use_controllers([own_file(tmp_path, old, new)])
    assert sentence in str(refused.value)
    assert "lead" not in CONTROLLERS
