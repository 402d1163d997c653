"""Campaigns that cannot be used: one sentence each."""

from pathlib import Path

import pytest

from hil.app.main import run
from tests.hil.app.campaign.campaigns import CAMPAIGN, RUNS


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[grid]", "[gird]", "did you mean 'grid'"),
        ("cases = 3", "cases = 0", "campaign.cases must lie in"),
        ("cases = 3", "cases = 600000", "at most 1000000 runs"),
        ("uniform = [0.06, 0.1]", "unifrom = [0.06, 0.1]", "did you mean 'uniform'"),
        ("uniform = [0.06, 0.1]", "uniform = [0.1, 0.06]", "[lower, upper]"),
        ('["pid", "pid_friction"]', '"pid"', "must be a list of values"),
        ("tissue.friction_coefficient", "tissue.friction", "friction_coefficient"),
        ("scenario.toml", "none.toml", "scenario must be a file that can be read"),
        ("set.effects", "put.effects", "variants.hidden must have"),
        ('name = "none"', "", "with a name"),
        ('name = "none"', 'name = "folds"', "a name of its own"),
        ("[[variants.hidden]]", "[[variants.case]]", "none be 'case'; got 'case' twice"),
        ("control.controller", "anatomy.seed", "got 'anatomy.seed' twice"),
        ('["pid", "pid_friction"]', '["pid", "pid"]', "values that differ"),
        ('"control.controller" =', "control.controller =", 'in quotes, as "control.controller"'),
        ('[draw."anatomy.seed"]', "[draw.anatomy.seed]", 'in quotes, as [draw."anatomy.seed"]'),
        ("[0, 1000]", "[0.2, 0.7]", "integers of at most"),
        ("[0, 1000]", "[0, 1000000000000000000000]", "integers of at most"),
        ("[0.06, 0.1]", "[-1.7e308, 1.7e308]", "finite numbers"),
        ("chunk = 2", 'metric = "tracking_rmse"', "campaign.metric must be one of tracking_rmse_m"),
        ("[grid]", "[grid]\n" + "".join(f'"a.k{k}" = {list(range(20))}\n' for k in range(9)), "at most 1000000 runs"),
        ("chunk = 2", 'engine = "trak"', "did you mean 'track'"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    campaign: Path, old: str, new: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in CAMPAIGN
    campaign.write_text(CAMPAIGN.replace(old, new))
    assert run(["campaign", str(campaign), "--out", str(campaign.parent / "out")]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def test_a_scenario_that_cannot_be_used_is_one_sentence(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (campaign.parent / "scenario.toml").write_text("rig = 3\n")
    assert run(["campaign", str(campaign), "--out", str(campaign.parent / "out")]) == 2
    assert capsys.readouterr().err == f"capsule: {campaign}: rig must be a table; got 3\n"
    (campaign.parent / "scenario.toml").write_text("[offer]\n")
    assert run(["campaign", str(campaign), "--out", str(campaign.parent / "out")]) == 2
    assert "scenario of a campaign must have no [offer]" in capsys.readouterr().err


def test_a_campaign_that_is_not_there_is_named_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["campaign", "none.toml"]) == 2
    assert capsys.readouterr().err.startswith("capsule: none.toml: campaign must be a file")


def test_options_that_cannot_be_are_one_sentence(
    campaign: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("hil.app.campaign.dask_cluster.ANSWER_S", 0.5)
    for options in (
        ["--run", str(RUNS)],
        ["--workers", "0"],
        ["--scheduler", "nowhere:1"],
        ["--scheduler", "nowhere:1", "--workers", "2"],
    ):
        assert run(["campaign", str(campaign), "--out", str(campaign.parent / "out"), *options]) == 2
        assert options[0] in capsys.readouterr().err
