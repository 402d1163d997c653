"""`close-loop` on any number of workers gives one answer, and within a budget says what it left out."""

import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.app.close_loop import print_summary
from hil.app.main import run
from tests.hil.app.campaign.campaigns import example_cluster
from tests.hil.findings import pull_finding

AXIS = '[rig]\nkind = "axis"\n[noise]\nforce_std_N = 0.02\n'
TIMES = ("seconds", "timings", "files")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An axis whose friction falls with speed in a form that is not the catalogue's."""
    folder, rng = tmp_path_factory.mktemp("lab"), np.random.default_rng(5)
    (folder / "rig.toml").write_text(AXIS)
    for name in ("a", "b", "held"):
        t = np.arange(0.0, 8.0, 2e-3)
        w, phase = rng.uniform(2.0, 6.0, 3), rng.uniform(0.0, 6.0, 3)
        angle = np.outer(t, w) + phase
        x, v, a = (0.02 * (f * w**k).sum(1) for k, f in enumerate((np.sin(angle), np.cos(angle), -np.sin(angle))))
        force = (
            2.0 * a + (0.5 + 0.4 / (1 + (v / 0.05) ** 2)) * np.sign(v) + 1.5 * v + 0.02 * rng.standard_normal(t.size)
        )
        table = np.column_stack((t, x, force))
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="t_s,position_m,force_N", comments="")
    return folder


def command(lab: Path, out: Path, *options: str) -> list[str]:
    records = [str(lab / name) for name in ("a.csv", "b.csv")]
    return [
        *("close-loop", *records, "--rig", str(lab / "rig.toml"), "--holdout", str(lab / "held.csv")),
        *("--out", str(out), "--json", *options),
    ]


def answer(lab: Path, out: Path, capfd: pytest.CaptureFixture[str], *options: str) -> tuple[dict[str, Any], str]:
    assert run(command(lab, out, *options)) == 0
    said = capfd.readouterr()
    report = json.loads(said.out)
    return {name: value for name, value in report.items() if name not in TIMES}, said.err


@pytest.mark.slow
def test_one_answer_on_any_workers(lab: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    alone, said = answer(lab, tmp_path / "one", capfd, "--workers", "1")
    assert "rows on 1 processor" in said
    assert [one["id"] for one in alone["effects"]]
    assert answer(lab, tmp_path / "two", capfd, "--workers", "2")[0] == alone
    if find_spec("distributed") is None:
        pytest.skip("needs Dask for the third: the extra 'dask' is not installed")
    with example_cluster() as address:
        assert answer(lab, tmp_path / "dask", capfd, "--scheduler", address)[0] == alone


def test_a_budget_ends_the_search_and_the_report_says_so(
    lab: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The budget is over at once, as on a machine that is slow beyond measure."""
    monkeypatch.setattr("hil.app.shared_options.seconds", lambda text, name: 1e-6)
    report, said = answer(lab, tmp_path / "out", capfd, "--budget", "1s")
    assert "takes about" in said
    assert report["stopped"] == "time"
    assert report["verdict"] == "unknown"
    assert sum("budget of time was spent" in line for line in report["statements"]) == 1


@pytest.mark.parametrize("options", [["--budget", "5 minutes"], ["--budget", "0s"], ["--workers", "0"]])
def test_wrong_options_are_one_sentence(
    lab: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], options: list[str]
) -> None:
    assert run(command(lab, tmp_path / "out", *options)) == 2
    assert options[0] in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_the_search_did_without_is_said_in_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    print_summary(replace(pull_finding(), left_out="It uses 24 of 200 records."), tmp_path)
    assert "It uses 24 of 200 records." in capsys.readouterr().out
