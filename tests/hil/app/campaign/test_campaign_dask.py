"""Campaigns on a Dask cluster of processes: every run once, whichever worker is killed; sentences where there is no
cluster.
"""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from hil.app.main import run
from tests.hil.app.campaign.campaigns import RUNS, campaign_files, rows_of, untimed
from tests.places import ROOT

pytestmark = pytest.mark.skipif(
    find_spec("distributed") is None, reason="needs Dask: the extra 'dask' is not installed"
)
LONGEST_S = 240.0


def said_by(*arguments: str) -> tuple[int, str, str]:
    """Status, output and errors of a Python process; all that it started is gone afterwards."""
    child = subprocess.Popen(
        [sys.executable, *arguments],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        said, complained = child.communicate(timeout=LONGEST_S)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.communicate()
    return child.returncode, said, complained


def story(name: str, folder: Path) -> dict[str, Any]:
    status, said, complained = said_by("-m", "tests.hil.app.campaign.dask_story", name, str(folder))
    assert status == 0, complained
    return dict(json.loads(said))


def number(row: dict[str, Any]) -> int:
    return int(row["run"])


@pytest.mark.slow
@pytest.mark.usefixtures("loaded_once")
def test_killed_workers_cost_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The only worker dies: a sentence, and what has ended is kept. The same command then goes on with two, of which
    one dies too.
    """
    path = campaign_files(tmp_path)
    found = story("killed", tmp_path)
    alone, beside, before = found["alone"], found["beside"], found["before"]
    assert (alone["killer"], alone["worker"], beside["killer"], beside["worker"]) == (0, -9, 0, -9)
    assert alone["held"]
    assert beside["held"]
    assert 1 <= alone["on_file"] <= before < before + 2 <= beside["on_file"] < RUNS

    assert alone["status"] == 2
    sentence = next(line for line in alone["said"].splitlines() if line.startswith("capsule: "))
    assert sentence.startswith(f"capsule: --scheduler must have workers; {found['address']} has named none for 2 s;")
    assert "Traceback" not in alone["said"] + beside["said"]

    assert beside["status"] == 0
    assert f'"resumed": {before},' in beside["said"]
    rows = rows_of(tmp_path / "out")
    assert sorted(row["run"] for row in rows) == list(range(RUNS))

    pool = tmp_path / "pool"
    assert run(["campaign", str(path), "--out", str(pool), "--workers", "1"]) == 0
    capsys.readouterr()
    assert [untimed(row) for row in sorted(rows, key=number)] == [
        untimed(row) for row in sorted(rows_of(pool), key=number)
    ]


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("failing")
    campaign_files(folder)
    return story("failing", folder)


@pytest.mark.slow
def test_a_run_that_kills_its_workers_is_a_row_and_costs_no_other(failing: dict[str, Any]) -> None:
    poison = failing["poison"]
    assert poison["status"] == 0, poison["said"]
    assert failing["left"] == 1
    rows = json.loads(poison["said"].splitlines()[-1])
    assert sorted(row["run"] for row in rows) == [0, 1, 2]
    errors = {row["run"]: row["error"] for row in rows}
    assert errors[0] == "its worker died 1 times"
    assert errors[1].startswith("rig.kind")
    assert errors[2].startswith("rig.kind")


@pytest.mark.slow
def test_a_scheduler_that_dies_is_one_sentence(failing: dict[str, Any]) -> None:
    orphan = failing["orphan"]
    assert orphan["status"] == 2
    assert 1 <= failing["on_file"] < RUNS
    *progress, sentence = orphan["said"].splitlines()
    assert sentence.startswith(f"capsule: --scheduler must stay until the last run; {failing['address']} has gone;")
    assert all(" %  runs" in line or "on the workers of the scheduler" in line for line in progress)


@pytest.mark.slow
def test_a_worker_of_another_program_is_refused_by_name(failing: dict[str, Any]) -> None:
    other = failing["other"]
    assert other["status"] == 2
    assert other["said"].startswith("capsule: --scheduler must have workers with this program, 0.")
    assert re.search(r"; tcp://127\.0\.0\.1:\d+ answers 0\.1 of yesterday\n$", other["said"])


@pytest.mark.slow
def test_an_address_where_something_else_says_nothing_is_one_sentence(failing: dict[str, Any]) -> None:
    ignored = failing["ignored"]
    assert ignored["status"] == 2
    assert ignored["said"].startswith("capsule: --scheduler must be the address of a Dask scheduler, as tcp://")
    assert f"got {failing['nobody']}: no answer" in ignored["said"]
    assert ignored["said"].count("\n") == 1
