"""Rows of a campaign: of one program, done again where the cause lay outside, few bytes whatever their number."""

import gzip
import json
import os
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest

from hil.app.campaign import running, worker
from hil.app.campaign.campaign import write_table
from hil.app.campaign.file import load_campaign
from hil.app.campaign.page import Runs, page_html
from hil.app.campaign.running import Results, run_missing
from hil.app.campaign.series import find_series
from hil.app.campaign.worker import Loop, pooled, run_job
from hil.app.cluster import Workers, program_version
from hil.app.main import run
from models.sets import measured_path
from models.theta import Theta
from tests.hil.app.campaign.campaigns import RUNS, rows_of
from tests.hil.app.campaign.test_campaign_folders import write_axis

pytestmark = pytest.mark.usefixtures("loaded_once")
BAD = {"rig": {"kind": "nothing"}}


def loop(number: int, raw: dict[str, Any] = BAD) -> Loop:
    return Loop(number, "track", raw, 0, {"case": number}, Theta(), "nominal")


def done(campaign: Path, *options: str) -> int:
    return run(["campaign", str(campaign), "--out", str(campaign.parent / "out"), "--workers", "1", *options])


def rewritten(out: Path, **change: Any) -> None:
    """The results, with the first row changed."""
    head, first, *rest = (out / "results.jsonl").read_text().splitlines()
    (out / "results.jsonl").write_text("\n".join([head, json.dumps(json.loads(first) | change), *rest]) + "\n")


def test_rows_of_another_program_stop_a_campaign_or_are_done_again(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = campaign.parent / "out"
    assert done(campaign) == 0
    assert {row["version"] for row in rows_of(out)} == {program_version()}
    first = rows_of(out)[0]["run"]
    rewritten(out, version="0.1 of yesterday")
    capsys.readouterr()
    assert done(campaign) == 2
    said = capsys.readouterr().err
    assert "results must be those of this program" in said
    assert "got 1 runs of 0.1 of yesterday: --retry does them again" in said
    assert done(campaign, "--retry") == 0
    assert [row["run"] for row in rows_of(out)].count(first) == 2
    again = rows_of(out)[-1]
    assert (again["run"], again["version"]) == (first, program_version())
    assert json.loads((out / "campaign.json").read_text())["all"]["runs"] == RUNS


def test_what_failed_from_outside_is_done_again_and_what_was_refused_stays(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = campaign.parent / "out"
    assert done(campaign) == 0
    rewritten(out, error="the disk is full", cause="outside", result={})
    assert done(campaign) == 0
    assert len(rows_of(out)) == RUNS + 1
    rewritten(out, error="rig.kind must be another one", cause="", result={})
    (out / "results.jsonl").write_text("\n".join((out / "results.jsonl").read_text().split("\n")[: RUNS + 1]) + "\n")
    capsys.readouterr()
    assert done(campaign) == 1
    assert len(rows_of(out)) == RUNS
    first = rows_of(out)[0]["run"]
    terminal = " ".join(capsys.readouterr().out.split())
    assert f"1 failed: rig.kind must be another one; the first is repeated by capsule campaign {campaign}" in terminal
    assert "worst: infinity" not in terminal
    found = json.loads((out / "campaign.json").read_text())
    assert [(one["error"], one["count"], one["runs"]) for one in found["failures"]] == [
        ("rig.kind must be another one", 1, [first])
    ]
    assert all(one["value"] > 0 for one in found["worst"])
    assert "Failed runs" in (out / "campaign.html").read_text()
    assert done(campaign, "--retry") == 0
    assert len(rows_of(out)) == RUNS + 1


@pytest.mark.parametrize(("error", "outside"), [(OSError(28, "No space left"), True), (ValueError("no"), False)])
def test_a_cause_outside_the_run_is_told_from_its_input(
    monkeypatch: pytest.MonkeyPatch, error: Exception, outside: bool
) -> None:
    def fails(_: Loop) -> Any:
        raise error

    monkeypatch.setattr(Loop, "result", fails)
    row = run_job(loop(0))
    assert (row.get("cause") == "outside") is outside
    assert row["error"]


def test_a_worker_needs_no_folder_of_the_reports_but_that_of_the_series(tmp_path: Path) -> None:
    write_axis(tmp_path / "lab" / "a", 1)
    [series] = find_series([tmp_path / "lab"], tmp_path / "nowhere" / "series")
    row = run_job(series)
    assert not (tmp_path / "nowhere").exists()
    series.keep(row["files"])
    report = json.loads((series.out / "report.json").read_text())
    assert report["verdict"] == row["result"]["verdict"]
    gone = run_job(replace(series, folder=tmp_path / "gone"))
    assert gone["cause"] == "outside"
    assert str(tmp_path / "gone") in gone["error"]


class Stopped(dict[str, Any]):
    """Tables that stop whoever unpacks them, where `once` is no file; it is made then."""

    def __init__(self, once: Path, makes: bool) -> None:
        self.once, self.makes = once, makes

    def __reduce__(self) -> Any:
        stop = "__import__('os').kill(__import__('os').getpid(), 19)"
        make = f"open({str(self.once)!r}, 'w').close()" if self.makes else "None"
        return eval, (f"__import__('os').path.exists({str(self.once)!r}) or ({make}, {stop}) and {BAD!r}",)


@pytest.mark.slow
def test_a_stopped_worker_is_killed_and_its_runs_are_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(worker, "_STARTS_S", 15.0)
    parts = [
        (loop(0),),
        (loop(1, Stopped(tmp_path / "once", True)),),
        (loop(2, Stopped(tmp_path / "never", False)),),
        (loop(3),),
    ]
    rows = {row["run"]: row["error"] for part in pooled(parts, 2, limit_s=0.5) for row in part}
    assert sorted(rows) == [0, 1, 2, 3]
    assert rows[2] == "it took longer than its limit of 0.5 s"
    assert [rows[number].partition(" ")[0] for number in (0, 3)] == ["rig.kind", "rig.kind"]
    assert "Error: " in rows[1]  # no tables any more
    assert 2 <= capsys.readouterr().err.count("a worker was silent") <= 4


def test_names_that_are_no_text_or_command_a_terminal_are_written_as_codes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each has a line and a report of its own: also a long one, a copy, one that looks like another, and a refused."""
    names = {b"r\xfcck\x1b[31m": "named", rb"r\xfcck\u001b[31m": "named", b"a\nb": "named", b"\xff" * 90: "named"}
    for name, verdict in {**names, b"copy": "named", b"bad\xfe": "refused"}.items():
        folder = tmp_path / "lab" / os.fsdecode(name)
        folder.mkdir(parents=True)
        kind = "periods" if verdict == "named" else "periodz"
        (folder / "rig.toml").write_text(f'[rig]\nkind = "{kind}"\nvelocity_m_s = 0.5e-3\n')
        shutil.copy(measured_path("analytical_table2_periods"), folder / os.fsdecode(b"run\xfc.csv"))
    assert run(["campaign", str(tmp_path / "lab"), "--out", str(tmp_path / "out"), "--workers", "1"]) == 1
    said = capsys.readouterr()
    assert "\x1b[31m" not in said.out + said.err
    series = json.loads((tmp_path / "out" / "campaign.json").read_text())["series"]
    shown = {one["name"]: one for one in series}
    assert [one["verdict"] for one in series].count("named") == 5
    assert sum(name.startswith(r"r\xfcck\u001b[31m ") for name in shown) == 2
    assert shown[r"a\nb"]["verdict"] == "named"
    assert shown[r"bad\xfe"]["refused"].endswith("did you mean 'periods'?")
    reports = {one["report"] for one in series if one["verdict"] == "named"}
    assert len(reports) == 5
    for report in reports:
        assert (tmp_path / "out" / report / "report.html").is_file()
        assert (
            tomllib.loads((tmp_path / "out" / report / "model.toml").read_text())["provenance"]["records"] == r"run\xfc"
        )
    page = (tmp_path / "out" / "campaign.html").read_text()
    assert r"r\xfcck\u001b[31m" in page
    assert program_version() in page


@pytest.mark.parametrize("kept", [OSError(13, "denied"), gzip.BadGzipFile("no gzip"), None])
def test_a_cause_that_was_put_in_words_is_still_told(monkeypatch: pytest.MonkeyPatch, kept: Exception | None) -> None:
    """What the system refuses lies outside; a file that is no archive is wrong itself."""

    def fails(_: Loop) -> Any:
        try:
            raise kept or KeyError
        except Exception:  # noqa: BLE001
            raise ValueError("a file must be one that can be read\nat all") from None

    monkeypatch.setattr(Loop, "result", fails)
    row = run_job(loop(0))
    assert (row.get("cause") == "outside") is (type(kept) is PermissionError)
    assert row["error"] == "a file must be one that can be read at all"


def test_what_is_there_is_shown_while_the_campaign_runs(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "SHOWN_S", 0.0)
    plan = load_campaign(campaign)
    seen: list[tuple[int, str]] = []
    with Results(campaign.parent / "results.jsonl", plan.fingerprint, program_version()) as results:

        def show() -> None:
            runs = Runs(results.rows(), plan.head.metric, list(plan.draws))
            seen.append((len(runs), page_html(plan.name, runs, "capsule", len(plan))))

        run_missing("c", range(len(plan)), plan.job, results, 2, Workers(1), shown=show)
    assert [count for count, _ in seen] == sorted({count for count, _ in seen})
    assert 0 < seen[0][0] < RUNS
    assert f"{RUNS - seen[0][0]} of {RUNS} runs are missing" in seen[0][1]
    assert "are missing" not in page_html(plan.name, Runs(Results(
        campaign.parent / "results.jsonl", plan.fingerprint, program_version()
    ).rows(), plan.head.metric), "capsule", len(plan))  # fmt: skip


def test_a_page_stays_small_whatever_the_number_of_runs(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)

    def row(k: int) -> dict[str, Any]:
        point = {"case": k // 2, "tissue.friction_coefficient": float(rng.uniform(0.06, 0.1)), "control": k % 2}
        result = {"tracking_rmse_m": float(rng.lognormal(-9.0, 0.3)), "hard_violations": k % 3 == 0, "faults": []}
        return {"run": k, "seed": k, "point": point, "seconds": 0.1, "version": "v", "result": result}

    rows = [row(k) for k in range(20_000)]
    runs = Runs(rows, "tracking_rmse_m", ["tissue.friction_coefficient"])
    small, large = (page_html("c", Runs(rows[:n], "tracking_rmse_m", runs.drawn), "capsule") for n in (2_000, 20_000))
    assert len(large) < min(1.01 * len(small), 3e6)
    values = np.array([one["result"]["tracking_rmse_m"] for one in rows])
    numbers = runs.summary()
    assert numbers["p95"] == pytest.approx(np.quantile(values, 0.95))
    assert (numbers["runs"], numbers["hard_violations"]) == (20_000, 6_667)
    assert [one["run"] for one in runs.worst] == np.argsort(values)[::-1][:12].tolist()

    path = tmp_path / "results.parquet"
    assert write_table(path, iter(rows)) == str(path)
    table = pyarrow.parquet.read_table(path)
    assert table.column("tracking_rmse_m").to_numpy() == pytest.approx(values)
    other = tmp_path / "series.parquet"
    write_table(other, [{"run": "0a", "seed": 1, "point": {"series": "a"}, "result": {"verdict": "none"}}])
    assert pyarrow.parquet.read_schema(other).equals(table.schema)
