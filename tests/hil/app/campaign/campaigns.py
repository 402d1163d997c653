"""A small campaign and what its rows hold, for the tests of campaigns."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.hil.app.run.deployments import TRUTH
from tests.places import ROOT

SCENARIO = f"[scenario]\nduration_s = 0.7\n{TRUTH}"
CAMPAIGN = """
[campaign]
scenario = "scenario.toml"
cases = 3
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
CASES, RUNS = 3, 12
TIMES = ("solve_ms", "estimate_ms", "real_time_factor")


def campaign_files(folder: Path) -> Path:
    (folder / "scenario.toml").write_text(SCENARIO)
    path = folder / "campaign.toml"
    path.write_text(CAMPAIGN)
    return path


def rows_of(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "results.jsonl").read_text().splitlines()[1:]]


def untimed(row: dict[str, Any]) -> dict[str, Any]:
    result = {key: value for key, value in row["result"].items() if key not in TIMES}
    return {**row, "result": result, "seconds": 0}


@contextmanager
def example_cluster() -> Iterator[str]:
    """The address of the scheduler of the example, with two workers on this machine; all are gone afterwards."""
    cluster = subprocess.Popen(
        [sys.executable, str(ROOT / "examples" / "cluster" / "cluster.py"), "--local", "--jobs", "2"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    try:
        assert cluster.stdout is not None
        yield cluster.stdout.readline().strip()
    finally:
        os.killpg(cluster.pid, signal.SIGKILL)
        cluster.communicate()
