"""A campaign over the bus, killed in the middle and resumed: what it takes, and that no run is lost or done twice.

`python -m tests.bench.bench_campaign [--cases 8] [--workers 2]`: each case is five runs of ten simulated seconds under
the MPC (`hil/scenarios/campaign_sil_faults.toml`: no fault, commands dropped, localisation lost, controller killed, a
babbling node). `--cases 200` are the thousand of the project's figure. The kill is SIGKILL to all its processes once a
third of the runs is on file. What is timed is what follows, by the wall clock and by the processor's; a kill may cost
each worker one chunk.
"""

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from hil.app.campaign.file import load_campaign

SCENARIOS = Path(__file__).parents[2] / "hil" / "scenarios"
RESULTS = "results.jsonl"


def campaign_of(folder: Path, cases: int) -> Path:
    """The shipped campaign with so many cases."""
    text = (
        (SCENARIOS / "campaign_sil_faults.toml").read_text(encoding="utf-8").replace("cases = 200", f"cases = {cases}")
    )
    text = text.replace('"track_magnetic_ramp.toml"', json.dumps(str(SCENARIOS / "track_magnetic_ramp.toml")))
    path = folder / "campaign.toml"
    path.write_text(text, encoding="utf-8")
    return path


def started(path: Path, out: Path, workers: int) -> subprocess.Popen[bytes]:
    """The campaign in a process group of its own, each process on one thread."""
    command = [
        sys.executable,
        "-m",
        "hil.app.start",
        "campaign",
        str(path),
        "--out",
        str(out),
        "--workers",
        str(workers),
        "--json",
    ]
    one = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True, env={**os.environ, **one}
    )


def whole_rows(out: Path) -> list[dict[str, Any]]:
    """The runs that stand in the results, without a line that a kill has cut."""
    path = out / RESULTS
    lines = path.read_bytes().split(b"\n")[1:-1] if path.exists() else []
    return [json.loads(line) for line in lines]


def killed_at(path: Path, out: Path, workers: int, count: int) -> list[dict[str, Any]]:
    """Start the campaign, kill it with all its workers once `count` runs are on file; what stands there then."""
    running = started(path, out, workers)
    while len(whole_rows(out)) < count and running.poll() is None:
        time.sleep(0.1)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    return whole_rows(out)


def main() -> None:
    """Print one object of what was measured; status 1 where a run was lost, done twice or changed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, out = Path(name), Path(name) / "out"
        out.mkdir()
        path = campaign_of(folder, options.cases)
        runs = len(load_campaign(path))
        before = killed_at(path, out, options.workers, max(1, runs // 3))
        began, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        status = started(path, out, options.workers).wait()
        wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
        rows = whole_rows(out)
    done = runs - len(before)
    cpu = after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime
    kept = rows[: len(before)] == before
    complete = sorted(row["run"] for row in rows) == list(range(runs))
    found = {
        "runs": runs,
        "on_file_at_kill": len(before),
        "resumed": done,
        "each_once": complete and kept,
        "status": status,
        "failed": sum("error" in row for row in rows),
        "unsafe": sum(fault["unsafe"] for row in rows for fault in row.get("result", {}).get("faults", [])),
        "wall_s_per_run": round(wall / done, 3),
        "processor_s_per_run": round(cpu / done, 3),
        "minutes_per_1000_runs": round(wall / done * 1000 / 60, 1),
        "minutes_per_1000_runs_on_two_free_cores": round(cpu / done * 1000 / 2 / 60, 1),
    }
    print(json.dumps(found, indent=2))
    sys.exit(0 if complete and kept else 1)


if __name__ == "__main__":
    main()
