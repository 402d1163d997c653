"""Campaigns: every run once, whatever is killed in between; each repeated by one command; sentences for files that cannot be used."""

from __future__ import annotations

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

from hil.app.campaign_file import Job, laid_over, load_campaign, nested
from hil.app.campaign_page import summary_of, worst_of
from hil.app.campaign_results import Results, chunks
from hil.app.campaign_work import TRIES, pooled, run_job
from hil.app.main import run
from tests.hil.deployments import TRUTH

SCENARIO = f"[scenario]\nduration_s = 0.7\n{TRUTH}"
CAMPAIGN = """
[campaign]
scenario = "scenario.toml"
cases = 6
seed = 3
chunk = 2
[draw."tissue.friction_coefficient"]
uniform = [0.06, 0.1]
[draw."anatomy.seed"]
integer = [0, 1000]
[grid]
"control.controller" = ["pid", "pid_friction"]
[[variants.hidden]]
name = "none"
[[variants.hidden]]
name = "folds"
set.effects.fold_periodic = { excess = 0.3, wavelength_m = 0.0073 }
"""
RUNS = 24
TIMES = ("solve_ms", "estimate_ms", "real_time_factor")


def campaign_files(folder: Path) -> Path:
    (folder / "scenario.toml").write_text(SCENARIO)
    path = folder / "campaign.toml"
    path.write_text(CAMPAIGN)
    return path


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return campaign_files(tmp_path)


def rows_of(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "results.jsonl").read_text().splitlines()[1:]]


def untimed(row: dict[str, Any]) -> dict[str, Any]:
    result = {key: value for key, value in row["result"].items() if key not in TIMES}
    return {**row, "result": result, "seconds": 0}


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


def test_a_killed_campaign_goes_on_without_loss_or_repetition(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = campaign.parent / "out"
    child = started(campaign, out)
    file = out / "results.jsonl"
    while not (file.exists() and file.read_bytes().count(b"\n") > 5):
        assert child.poll() is None
        time.sleep(0.02)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    end = time.monotonic() + 20
    while alive(child.pid) and time.monotonic() < end:
        time.sleep(0.1)
    assert not alive(child.pid)
    before = rows_of(out)
    assert 5 <= len(before) < RUNS
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
    assert len({job.seed for job in jobs}) == 6
    for case in range(6):
        four = jobs[4 * case : 4 * case + 4]
        assert len({json.dumps([job.raw["tissue"], job.raw["anatomy"], job.seed]) for job in four}) == 1
        assert {(job.raw["control"]["controller"], "effects" in job.raw) for job in four} == {
            (name, folds) for name in ("pid", "pid_friction") for folds in (False, True)
        }
    assert all(0.06 <= job.raw["tissue"]["friction_coefficient"] <= 0.1 for job in jobs)
    assert len({job.raw["tissue"]["friction_coefficient"] for job in jobs}) == 6


def test_results_of_another_campaign_are_not_mixed(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = campaign.parent / "out"
    out.mkdir()
    Results(out / "results.jsonl", load_campaign(campaign).fingerprint).close()
    campaign.write_text(CAMPAIGN.replace("seed = 3", "seed = 4"))
    assert run(["campaign", str(campaign), "--out", str(out)]) == 2
    assert "must be those of this campaign" in capsys.readouterr().err


def test_two_processes_do_not_write_one_file(tmp_path: Path) -> None:
    first = Results(tmp_path / "results.jsonl", "x")
    with pytest.raises(ValueError, match="one process at a time"):
        Results(tmp_path / "results.jsonl", "x")
    first.close()
    Results(tmp_path / "results.jsonl", "x").close()


@given(st.lists(st.lists(st.integers(0, 30), max_size=5), max_size=8), st.integers(0, 400))
def test_a_file_cut_anywhere_keeps_its_whole_lines(
    tmp_path_factory: pytest.TempPathFactory, parts: list[list[int]], cut: int
) -> None:
    path = tmp_path_factory.mktemp("results") / "results.jsonl"
    results = Results(path, "f")
    for part in parts:
        results.add([{"run": number, "result": {}} for number in part])
    results.close()
    whole = path.read_bytes()
    path.write_bytes(whole[:cut])
    again = Results(path, "f")
    kept = whole[:cut].count(b"\n")
    assert len(again.done) == max(kept - 1, 0)
    again.add([{"run": number} for part in parts for number in part])
    again.close()
    numbers = [json.loads(line)["run"] for line in path.read_bytes().splitlines()[1:]]
    assert sorted(numbers) == sorted({number for part in parts for number in part})


@given(st.integers(0, 100), st.integers(1, 9))
def test_chunks_are_all_runs_in_order(count: int, size: int) -> None:
    parts = chunks(range(count), size)
    assert [number for part in parts for number in part] == list(range(count))
    assert all(1 <= len(part) <= size for part in parts)


def job(number: int, raw: dict[str, Any]) -> Job:
    return Job(number, "track", raw, 0, {"case": number}, {}, "nominal")


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
    assert all(rows[number].startswith("ValueError") for number in (0, 1, 3, 4))


def test_a_run_that_fails_is_a_row_and_the_worst_case() -> None:
    row = run_job(job(7, {"rig": {"kind": "nothing"}}))
    good = {"run": 1, "point": {}, "result": {"tracking_rmse_m": 1.0, "faults": [], "hard_violations": 2}}
    assert worst_of([good, row], "tracking_rmse_m")[0] is row
    numbers = summary_of([good, row], "tracking_rmse_m")
    assert (numbers["runs"], numbers["failed"], numbers["max"], numbers["hard_violations"]) == (2, 1, 1.0, 2)


def test_the_bus_is_another_engine(campaign: Path) -> None:
    text = '[campaign]\nengine = "sil"\nscenario = "scenario.toml"\n[[variants.fault]]\nname = "drop"\n'
    campaign.write_text(text + 'set.faults = [{ kind = "drop", target = "commands", at_s = 0.3, duration_s = 0.2 }]\n')
    row = run_job(load_campaign(campaign).job(0))
    assert row["result"]["faults"][0]["unsafe"] is False
    assert row["result"]["bus"]["frames"] > 100


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[grid]", "[gird]", "did you mean 'grid'"),
        ("cases = 6", "cases = 0", "campaign.cases must lie in"),
        ("cases = 6", "cases = 600000", "at most 1000000 runs"),
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


def test_options_that_cannot_be_are_one_sentence(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for options in (
        ["--run", "24"],
        ["--workers", "0"],
        ["--scheduler", "nowhere:1"],
        ["--scheduler", "nowhere:1", "--workers", "2"],
    ):
        assert run(["campaign", str(campaign), "--out", str(campaign.parent / "out"), *options]) == 2
        assert options[0] in capsys.readouterr().err


@given(st.recursive(st.integers(), lambda inner: st.dictionaries(st.sampled_from("abc"), inner, max_size=3), max_leaves=8))
def test_tables_laid_over_themselves_are_themselves(table: Any) -> None:
    over = table if isinstance(table, dict) else {"a": table}
    assert laid_over(over, over) == over
    assert laid_over({}, over) == over
    assert laid_over(over, nested("x.y", 1))["x"] == {"y": 1}


def test_files_of_the_scenarios_folder_are_campaigns() -> None:
    folder = Path(__file__).parents[2] / "hil" / "scenarios"
    sizes: Sequence[int] = [len(load_campaign(path)) for path in sorted(folder.glob("campaign_*.toml"))]
    assert sizes
    assert all(size >= 1000 for size in sizes)
