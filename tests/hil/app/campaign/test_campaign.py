"""Campaigns: every run once, whatever is killed in between; each repeated by one command."""

import contextlib
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.app.campaign import running
from hil.app.campaign.file import laid_over, load_campaign, nested
from hil.app.campaign.page import Runs, page_html
from hil.app.campaign.running import Results, run_missing
from hil.app.campaign.worker import TRIES, Loop, pooled, run_job
from hil.app.cluster import Workers, program_version
from hil.app.main import run
from models.theta import Theta
from tests.hil.app.campaign.campaigns import CAMPAIGN, CASES, RUNS, rows_of, untimed
from tests.places import SCENARIOS

pytestmark = pytest.mark.usefixtures("loaded_once")


def started(campaign: Path, out: Path, heard: int = subprocess.DEVNULL) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "hil.app.start", "campaign", str(campaign), "--out", str(out), "--workers", "1"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=heard, text=True, start_new_session=True)


def alive(group: int) -> list[str]:
    """Processes of a group that are not mere zombies."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            name, _, rest = stat.read_text().rpartition(")")
            state, _, its_group = rest.split()[:3]
            if int(its_group) == group and state != "Z":
                found.append(name)
    return found


def test_an_interrupted_campaign_says_what_it_kept(campaign: Path) -> None:
    out = campaign.parent / "out"
    # what a shell has put aside with & is deaf to SIGINT, and so would its child be
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        child = started(campaign, out, subprocess.PIPE)
    finally:
        signal.signal(signal.SIGINT, before)
    file = out / "results.jsonl"
    while not (file.exists() and file.read_bytes().count(b"\n") > 3):
        assert child.poll() is None
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=60)
    kept = len(rows_of(out))
    assert child.returncode == 130
    assert said.endswith(
        f"capsule: interrupted: {kept} of {RUNS} runs are on file in {file}; the same command goes on from there\n"
    )


def test_a_killed_campaign_goes_on_without_loss_or_repetition(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = campaign.parent / "out"
    child = started(campaign, out)
    file = out / "results.jsonl"
    while not (file.exists() and file.read_bytes().count(b"\n") > 3):
        assert child.poll() is None
        time.sleep(0.02)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    end = time.monotonic() + 20
    while alive(child.pid) and time.monotonic() < end:
        time.sleep(0.1)
    assert not alive(child.pid)
    before = rows_of(out)
    assert 3 <= len(before) < RUNS
    file.write_bytes(file.read_bytes() + b'{"run": 23, "se')

    assert run(["campaign", str(campaign), "--out", str(out), "--workers", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    rows = rows_of(out)
    assert sorted(row["run"] for row in rows) == list(range(RUNS))
    assert rows[: len(before)] == before
    assert found["resumed"] == len(before)
    assert found["all"]["runs"] == RUNS
    assert found["all"]["failed"] == 0
    assert (out / "campaign.html").read_text().count("--run ") == 12

    worst = found["worst"][0]
    assert worst["value"] == max(row["result"]["tracking_rmse_m"] for row in rows)
    assert run(shlex.split(worst["repeat"])[1:]) == 0
    again = json.loads(capsys.readouterr().out)
    assert untimed(again) == untimed(next(row for row in rows if row["run"] == worst["run"]))

    written = file.read_bytes()
    assert run(["campaign", str(campaign), "--out", str(out)]) == 0
    assert file.read_bytes() == written


def test_runs_of_one_case_share_seed_and_draws(campaign: Path) -> None:
    plan = load_campaign(campaign)
    assert len(plan) == RUNS
    jobs = [plan.job(number) for number in range(RUNS)]
    assert len({job.seed for job in jobs}) == CASES
    for case in range(CASES):
        four = jobs[4 * case : 4 * case + 4]
        assert len({json.dumps([job.raw["tissue"], job.raw["anatomy"], job.seed]) for job in four}) == 1
        assert {(job.raw["control"]["controller"], "effects" in job.raw) for job in four} == {
            (name, folds) for name in ("pid", "pid_friction") for folds in (False, True)
        }
    assert all(0.06 <= job.raw["tissue"]["friction_coefficient"] <= 0.1 for job in jobs)
    assert len({job.raw["tissue"]["friction_coefficient"] for job in jobs}) == CASES


def test_results_of_another_campaign_are_not_mixed(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = campaign.parent / "out"
    out.mkdir()
    Results(out / "results.jsonl", load_campaign(campaign).fingerprint, program_version()).close()
    campaign.write_text(CAMPAIGN.replace("seed = 3", "seed = 4"))
    assert run(["campaign", str(campaign), "--out", str(out)]) == 2
    assert "must be those of this campaign" in capsys.readouterr().err


def test_two_processes_do_not_write_one_file(tmp_path: Path) -> None:
    first = Results(tmp_path / "results.jsonl", "x")
    with pytest.raises(ValueError, match="one process at a time"):
        Results(tmp_path / "results.jsonl", "x")
    first.close()
    Results(tmp_path / "results.jsonl", "x").close()


def row(number: int) -> dict[str, Any]:
    return {"run": number, "seed": 0, "point": {}, "seconds": 0.1, "version": "", "result": {}}


@given(st.lists(st.lists(st.integers(0, 30), max_size=5), max_size=8), st.integers(0, 400))
def test_a_file_cut_anywhere_keeps_its_whole_lines(
    tmp_path_factory: pytest.TempPathFactory, parts: list[list[int]], cut: int
) -> None:
    path = tmp_path_factory.mktemp("results") / "results.jsonl"
    results = Results(path, "f")
    for part in parts:
        results.add(map(row, part))
    results.close()
    whole = path.read_bytes()
    path.write_bytes(whole[:cut])
    again = Results(path, "f")
    kept = whole[:cut].count(b"\n")
    assert len(again.done) == max(kept - 1, 0)
    again.add(row(number) for part in parts for number in part)
    again.close()
    numbers = [json.loads(line)["run"] for line in path.read_bytes().splitlines()[1:]]
    assert sorted(numbers) == sorted({number for part in parts for number in part})


@pytest.mark.parametrize(
    "damage", [b"\0" * 40, b"{}", b'{"run": 1, "result": {}}', b'{"run": 1, "seed": 0, "poi', b"[1]", b"\xff"]
)
def test_lines_that_are_no_rows_are_left_out_and_their_runs_done_again(
    tmp_path: Path, damage: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "results.jsonl"
    with Results(path, "f") as results:
        results.add(map(row, (0, 1, 2)))
    lines = path.read_bytes().split(b"\n")
    path.write_bytes(b"\n".join([*lines[:2], damage, *lines[3:]]))
    with Results(path, "f") as again:
        assert sorted(again.done) == [0, 2]
        assert "1 line is not of a campaign and is left out" in capsys.readouterr().err
        again.add([row(1)])
        assert sorted(one["run"] for one in again.rows()) == [0, 1, 2]


@pytest.mark.parametrize("text", ["my own notes", "my own\nnotes\n", '{"another": 1}\n'])
def test_a_file_of_somebody_else_is_left_as_it_is(tmp_path: Path, text: str) -> None:
    path = tmp_path / "results.jsonl"
    path.write_text(text)
    with pytest.raises(ValueError, match="results must be"):
        Results(path, "f")
    assert path.read_text() == text


@pytest.mark.parametrize(
    "answer", [None, [], ["garbage"], [{"run": 0}], [row(7)], [row(0), row(0)], [{**row(0), "point": "x"}], [row(0)]]
)
def test_a_worker_that_answers_garbage_loses_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: Any
) -> None:
    def answering(*_: Any, **__: Any) -> Any:
        return iter([answer])

    monkeypatch.setattr(running, "pooled", answering)
    with Results(tmp_path / "results.jsonl", "f") as results:
        with pytest.raises(ValueError, match=r"workers must answer with .*rows? "):
            run_missing("c", range(2), lambda k: job(k, {}), results, 1, Workers(1))
        assert set(results.done) <= {0}


def job(number: int, raw: dict[str, Any]) -> Loop:
    return Loop(number, "track", raw, 0, {"case": number}, Theta(), "nominal")


class Poison(dict[str, Any]):
    """Tables that kill whoever unpacks them in a process of a pool."""

    def __reduce__(self) -> Any:
        return os._exit, (1,)


def test_a_run_that_kills_its_worker_costs_no_other_run() -> None:
    bad = {"rig": {"kind": "nothing"}}
    parts = [(job(0, bad), job(1, bad)), (job(2, Poison()),), (job(3, bad), job(4, bad))]
    rows = {row["run"]: row["error"] for part in pooled(parts, 2) for row in part}
    assert sorted(rows) == [0, 1, 2, 3, 4]
    assert rows[2] == f"its worker died {TRIES} times"
    assert all(rows[number].startswith("rig.kind") for number in (0, 1, 3, 4))


def test_runs_that_fail_are_told_with_their_reason_and_hide_no_worst_case() -> None:
    row = run_job(job(7, {"rig": {"kind": "nothing"}}))
    good = {"run": 1, "point": {}, "result": {"tracking_rmse_m": 1.0, "faults": [], "hard_violations": 2}}
    silent = {"run": 2, "point": {}, "result": {"tracking_rmse_m": None}}
    runs = Runs([good, silent, *({**row, "run": 7 + k} for k in range(20))], "tracking_rmse_m")
    assert runs.worst == [good]
    numbers = runs.summary()
    assert (numbers["runs"], numbers["failed"], numbers["max"], numbers["hard_violations"]) == (22, 21, 1.0, 2)
    outside = Runs([{**row, "cause": "outside", "error": "no space left"}], "tracking_rmse_m")
    assert list(outside.failures) == ["no space left; the next start does it again"]
    assert {error: len(failed) for error, failed in runs.failures.items()} == {
        row["error"]: 20,
        "its result has no number tracking_rmse_m": 1,
    }


def test_the_bus_is_another_engine(campaign: Path) -> None:
    text = '[campaign]\nengine = "sil"\nscenario = "scenario.toml"\n[[variants.fault]]\nname = "drop"\n'
    campaign.write_text(text + 'set.faults = [{ kind = "drop", target = "commands", at_s = 0.3, duration_s = 0.2 }]\n')
    row = run_job(load_campaign(campaign).job(0))
    assert row["result"]["faults"][0]["unsafe"] is False
    assert row["result"]["bus"]["frames"] > 100


@given(
    st.recursive(st.integers(), lambda inner: st.dictionaries(st.sampled_from("abc"), inner, max_size=3), max_leaves=8)
)
def test_tables_laid_over_themselves_are_themselves(table: Any) -> None:
    over = table if isinstance(table, dict) else {"a": table}
    assert laid_over(over, over) == over
    assert laid_over({}, over) == over
    assert laid_over(over, nested("x.y", 1))["x"] == {"y": 1}


def test_files_of_the_scenarios_folder_are_campaigns() -> None:
    folder = SCENARIOS
    sizes: Sequence[int] = [len(load_campaign(path)) for path in sorted(folder.glob("campaign_*.toml"))]
    assert sizes
    assert all(size >= 1000 for size in sizes)


def test_runs_are_told_apart_by_what_differs_with_whole_seeds() -> None:
    rows = [
        {
            "run": k,
            "point": {"case": 0, "scenario.duration_s": 2.0, "anatomy.seed": 475813, "control.controller": name},
            "result": {"tracking_rmse_m": 1e-4, "hard_violations": 0, "faults": []},
        }
        for k, name in enumerate(("pid", "mpc"))
    ]
    page = page_html("c", Runs(rows, "tracking_rmse_m", ["anatomy.seed"]), "capsule campaign c.toml")
    assert "<td>controller pid</td>" in page.replace(' class="word"', "")
    assert "duration 2 s" in page
    assert "seed 475813" in page
