"""What long and many records cost: rows of one motion, records of one rig, workers.

`python -m tests.bench.bench_long [--rows 20000 2000000] [--records 12 200] [--seconds 40]`: an axis whose friction
falls with speed, in a form that is not the catalogue's. Each case is a process of its own: processor time of it and its
workers, wall time, its greatest memory, the verdict. The last two lines are the first case on one worker and on two.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from models.identification.identify import close
from models.records.record import Record, record_of
from models.rigs.reader import read_rig
from models.rigs.rig import Rig
from models.workers import cores, working

RIG = '[rig]\nkind = "axis"\n[noise]\nforce_std_N = 0.02\n'


def record(rig: Rig, seed: int, rows: int, seconds: float) -> Record:
    """`rows` rows of so many `seconds` of a motion that `seed` draws."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, seconds, rows, endpoint=False)
    w, phase = rng.uniform(2.0, 6.0, 3), rng.uniform(0.0, 6.0, 3)
    angle = np.outer(t, w) + phase
    x, v, a = (0.02 * (f * w**k).sum(1) for k, f in enumerate((np.sin(angle), np.cos(angle), -np.sin(angle))))
    friction = (0.5 + 0.4 / (1 + (v / 0.05) ** 2)) * np.sign(v) + 1.5 * v
    force = 2.0 * a + friction + 0.02 * np.random.default_rng(seed + 1000).standard_normal(rows)
    return record_of(f"record_{seed}", {"t_s": t, "position_m": x, "force_N": force}, rig)


def case(rows: int, count: int, workers: int, seconds: float) -> dict[str, object]:
    """`close` on `count` records of `rows` rows and a held-out one."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "rig.toml").write_text(RIG)
        rig = read_rig(Path(folder) / "rig.toml")
    train, held = [record(rig, k, rows, seconds) for k in range(count)], [record(rig, 999, rows, seconds)]
    began, spent = time.perf_counter(), time.process_time()
    with working(workers):
        finding, _ = close(rig, train, held, lambda *_: None)
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "rows": rows,
        "records": count,
        "workers": workers,
        "processor_s": round(time.process_time() - spent + children.ru_utime + children.ru_stime, 1),
        "wall_s": round(time.perf_counter() - began, 1),
        "memory_MB": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3),
        "verdict": finding.verdict,
        "effects": [effect.id for effect in finding.effects],
    }


def alone(seconds: float, *numbers: int) -> None:
    """The case in a process of its own, printed."""
    words = [sys.executable, "-m", "tests.bench.bench_long", f"--seconds={seconds}", "--case", *map(str, numbers)]
    print(subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip(), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, nargs="+", default=[20_000, 2_000_000])
    parser.add_argument("--records", type=int, nargs="+", default=[12, 200])
    parser.add_argument("--seconds", type=float, default=40.0, help="of a record")
    parser.add_argument("--case", type=int, nargs=3, help="rows, records, workers: that case alone")
    asked = parser.parse_args()
    if asked.case:
        print(json.dumps(case(*asked.case, asked.seconds)))
        return
    for rows in asked.rows:
        alone(asked.seconds, rows, 1, cores())
    for count in asked.records:
        alone(asked.seconds, asked.rows[0], count, cores())
    for workers in (1, 2):
        alone(asked.seconds, asked.rows[0], 1, workers)


if __name__ == "__main__":
    main()
