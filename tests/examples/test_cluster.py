"""The example cluster: a campaign runs on it, on this machine as it would on SLURM's."""

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from hil.app.main import run
from tests.hil.app.campaign.campaigns import RUNS, campaign_files, example_cluster


@pytest.mark.slow
@pytest.mark.skipif(find_spec("distributed") is None, reason="needs Dask: the extra 'dask' is not installed")
def test_a_campaign_runs_on_the_example_cluster(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    campaign, out = campaign_files(tmp_path), tmp_path / "out"
    with example_cluster() as address:
        status = run(["campaign", str(campaign), "--out", str(out), "--scheduler", address])
    assert status == 0, capfd.readouterr().err
    assert json.loads((out / "campaign.json").read_text())["all"]["runs"] == RUNS
