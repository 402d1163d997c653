"""The example cluster: a campaign runs on it, on this machine as it would on SLURM's."""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from hil.app.main import run
from tests.hil.app.campaign.campaigns import RUNS, campaign_files
from tests.places import ROOT

CLUSTER = ROOT / "examples" / "cluster" / "cluster.py"


@pytest.mark.slow
@pytest.mark.skipif(find_spec("distributed") is None, reason="needs Dask: the extra 'dask' is not installed")
def test_a_campaign_runs_on_the_example_cluster(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    campaign, out = campaign_files(tmp_path), tmp_path / "out"
    with subprocess.Popen(
        [sys.executable, str(CLUSTER), "--local", "--jobs", "2"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as cluster:
        assert cluster.stdout is not None
        address = cluster.stdout.readline().strip()
        try:
            status = run(["campaign", str(campaign), "--out", str(out), "--scheduler", address])
        finally:
            cluster.terminate()
    assert status == 0, capfd.readouterr().err
    assert json.loads((out / "campaign.json").read_text())["all"]["runs"] == RUNS
