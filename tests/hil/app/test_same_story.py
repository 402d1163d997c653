"""Page, terminal and JSON of a command tell the same story."""

import html
import json
import re
from pathlib import Path
from typing import Any

import pytest

from hil.app.main import run
from models.words.quantities import fixed, number, quantity
from tests.hil.app.sil.test_sil import SHORT
from tests.hil.app.track.track_texts import SHORT as TRACK
from tests.places import ROOT

OWN = ROOT / "examples" / "own_record"


def text_of(page: Path) -> str:
    """What a reader sees, each run of blanks as one."""
    whole = page.read_text(encoding="utf-8").replace("<wbr>", "")
    shown = re.sub(r"<(script|style).*?</\1>", " ", whole, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", shown)).split())


def runs_of(found: dict[str, Any]) -> list[dict[str, Any]]:
    return list(found.get("runs", [found]))


def story(one: dict[str, Any]) -> list[str]:
    """What must stand everywhere of a run, by its JSON object."""
    said = [one["scenario"], one["controller"], one["model"], one["monitor"]["state"].split("_")[0]]
    lengths = ("tracking_rmse_m", "tracking_max_m", "final_error_m", "mean_speed_m_s")
    said += [fixed(1e3 * one[key], 3) for key in lengths]
    said += [fixed(1e3 * one[key], 1) for key in ("wall_force_max_N", "effort")]
    said += [fixed(one[what][key], 3) for what in ("solve_ms", "estimate_ms") for key in ("median", "p99", "max")]
    said += [f"{status} {count}" for status, count in one["ticks"].items() if count and status != "ok"]
    said += [] if one["ended"] == "done" else [one["ended"]]
    said += [event["reason"] for event in one["events"]]
    for check in one.get("checks", ()):
        said += [number(check["value"]), number(check["limit"]), "passed" if check["passed"] else "FAILED"]
    said += [f"{one['bus']['frames']} frames"] if "bus" in one else []
    for fault in one.get("faults", ()):
        said += [f"fault at {fault['at_s']:g} s ({fault['fault']})", f"safe after {fault['safe_after_ms']:.1f} ms"]
    return said


@pytest.mark.parametrize(
    ("command", "text", "words"),
    [
        ("track", TRACK + "[checks]\nrmse_mm = 1.0\nworst_mm = 1e-4\n", ["--controller", "pid"]),
        ("track", TRACK, ["--controller", "feedforward"]),
        ("sil", SHORT, []),
        ("sil", SHORT, ["--compare", "pid,feedforward"]),
    ],
)
def test_a_run_is_told_alike_on_page_terminal_and_in_json(
    tmp_path: Path, command: str, text: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "scenario.toml").write_text(text, encoding="utf-8")
    out = tmp_path / "out"
    run([command, str(tmp_path / "scenario.toml"), "--out", str(out), *words])
    terminal = " ".join(capsys.readouterr().out.split())
    page, found = text_of(out / f"{command}.html"), json.loads((out / f"{command}.json").read_text())
    assert len(runs_of(found)) == (2 if "--compare" in words else 1)
    for one in runs_of(found):
        for said in story(one):
            assert said in terminal
            assert said in page
    best = min(runs_of(found), key=lambda one: one["tracking_rmse_m"])
    head = f"{best['controller']} with the {best['model']} model tracks"
    assert head in terminal
    assert head in page
    assert quantity(best["tracking_rmse_m"], "m") in page
    figures = re.search("class=.plot.", (out / f"{command}.html").read_text())
    assert figures
    assert figures.start() < (out / f"{command}.html").read_text().index("<table")


def test_a_check_is_told_alike_on_page_terminal_and_in_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [str(OWN / "pull_1.csv"), "--rig", str(OWN / "rig.toml")]
    assert run(["check", *words, "--out", str(tmp_path)]) == 0
    terminal = " ".join(capsys.readouterr().out.split())
    page, found = text_of(tmp_path / "check.html"), json.loads((tmp_path / "check.json").read_text())
    assert run(["check", *words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == found
    assert found["findings"]
    for one in found["findings"]:
        for key in ("file", "where", "sentence", "remedy"):
            assert one[key] in terminal
            assert one[key] in page
    head = f"{len(found['findings'])} findings on these records"
    assert head in terminal
    assert head in page
    for why in found["cannot_show"].values():
        assert why in terminal
        assert why in page
    assert found["smallest_detectable"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--compare", "pid,feedforwad"], "did you mean 'feedforward'"),
        (["--compare", "pid,pid"], "must name different controllers"),
        (["--compare", "pid", "--controller", "pid"], "must stand without --controller"),
        (["--compare", "pid,mpc", "--learn"], "must stand without --learn"),
    ],
)
def test_a_comparison_that_cannot_be_made_is_refused_in_one_sentence(
    tmp_path: Path, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "short.toml").write_text(SHORT, encoding="utf-8")
    assert run(["sil", str(tmp_path / "short.toml"), *words]) == 2
    said = capsys.readouterr()
    assert sentence in said.err
    assert said.out == ""
