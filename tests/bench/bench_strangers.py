"""What is said of series as strangers record them: the plant's series with one fault of wiring, instrument or protocol.

`python -m tests.bench.bench_strangers --out DIR [--seeds 2] [--seconds 45] [--workers 2] [ROW...]` makes each row's
series for so many seeds, runs `capsule close-loop` on it with its hold-out, and prints a table: what was said, the
findings that headed the report, the held-out error in floors, the time, and whether that is right. `--shared` adds
the shared series that the rows have in mind. What is on file is not run again.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from plant.experiments.scenario import write_record
from tests.places import SHARED
from tests.plant.series import make_series

_FINER = 10
Columns = dict[str, npt.NDArray[np.float64]]
Spoil = Callable[[Columns, np.random.Generator], Columns]
NAMES: Final = ("train_1", "train_2", "train_3", "holdout")


@dataclass(frozen=True)
class Right:
    """What is right to say: one of these verdicts (empty: none is reached), an effect that must stand in a class, and
    words that the findings must have.
    """

    verdicts: tuple[str, ...]
    effect: str | None = None
    words: str = ""
    stops: bool = False


@dataclass(frozen=True)
class Row:
    """One fault: a series of the plant, how its records are spoiled, what the rig file says instead, what is right."""

    what: str
    kind: str
    effect: str | None
    right: Right
    spoil: Spoil | None = None
    rig: Callable[[str], str] = lambda text: text
    noise: float = 1.0
    rate_Hz: float = 500.0
    measured: str = "force_N"


def turned(c: Columns, rng: np.random.Generator) -> Columns:
    """The force's sign turned round."""
    return {**c, "force_N": -c["force_N"]}


def clipped(c: Columns, rng: np.random.Generator) -> Columns:
    """2.5 % of the samples beyond the amplifier's range."""
    return {**c, "force_N": np.clip(c["force_N"], *np.quantile(c["force_N"], [0.0125, 0.9875]))}


def late(c: Columns, rng: np.random.Generator) -> Columns:
    """The force 20 ms late."""
    return {**c, "force_N": np.interp(c["t_s"] - 0.02, c["t_s"], c["force_N"])}


def uneven(c: Columns, rng: np.random.Generator) -> Columns:
    """Of a record at 5 kHz, rows at 500 Hz uneven by 20 % of the interval to either side, 2 % of them missing."""
    rows = np.arange(_FINER, c["t_s"].size - _FINER, _FINER)
    rows = rows[rng.random(rows.size) > 0.02]
    rows += rng.integers(-_FINER // 5, _FINER // 5 + 1, rows.size)
    return {name: values[np.concatenate([[0], rows])] for name, values in c.items()}


def again(c: Columns, rng: np.random.Generator) -> Columns:
    """The logger was started anew in the middle: stamps begin again at 0."""
    t, half = c["t_s"].copy(), c["t_s"].size // 2
    t[half:] -= t[half]
    return {**c, "t_s": t}


def thinned(rate_Hz: float, std_m: float) -> Spoil:
    """A localiser of `rate_Hz` and `std_m` in place of the ideal one."""

    def spoil(c: Columns, rng: np.random.Generator) -> Columns:
        every = round(1 / (rate_Hz * float(np.median(np.diff(c["t_s"])))))
        c = {name: values[::every] for name, values in c.items()}
        return {**c, "position_m": c["position_m"] + std_m * rng.standard_normal(c["position_m"].size)}

    return spoil


def poor(c: Columns, rng: np.random.Generator) -> Columns:
    """3.87 mN more of noise, so 4 mN where the rig file says 1 mN, and uneven stamps."""
    c = uneven(c, rng)
    return {**c, "force_N": c["force_N"] + 3.87e-3 * rng.standard_normal(c["force_N"].size)}


def one_way(c: Columns, rng: np.random.Generator) -> Columns:
    """400 rows, one way at one speed, a constant 50 mN and noise: nothing to learn from."""
    t = np.arange(400) * 0.01
    return {"t_s": t, "position_m": 1e-3 * t, "force_N": 0.05 + 1e-3 * rng.standard_normal(400)}


def _std(metres: float) -> Callable[[str], str]:
    return lambda text: re.sub(r"position_std_m = .*", f"position_std_m = {metres:g}", text)


def _unstated(text: str) -> str:
    return re.sub(r"\[noise\][^[]*", "", text)


NAMED, NONE, UNKNOWN = ("named",), ("none",), ("unknown",)
LAG: Final = Right(NAMED, "actuator_lag")
ROWS: Final[dict[str, Row]] = {
    "sign": Row("force's sign turned round", "pull", None, Right((), words="sign", stops=True), turned),
    "clipped": Row("2.5 % of the samples clipped", "pull", None, Right(UNKNOWN, words="clip"), clipped),
    "one_way": Row("400 rows, one way, constant force", "pull", None, Right(UNKNOWN, words="no parameter"), one_way),
    "late": Row("force 20 ms late", "pull", None, Right(NAMED, "sensor_delay", words="later"), late),
    "uneven": Row(
        "stamps uneven by 20 %, 2 % missing", "pull", None, Right(NONE, words="scatters"), uneven, rate_Hz=5000.0
    ),
    "uneven_folds": Row(
        "the same, folds hidden", "pull", "fold_periodic", Right(NAMED, "fold_periodic"), uneven, rate_Hz=5000.0
    ),
    "slow": Row("localisation of 30 Hz, 1 mm", "magnetic", None, Right(NONE), thinned(30, 1e-3), _std(1e-3)),
    "slow_narrow": Row(
        "the same, a narrow place hidden",
        "magnetic",
        "stenosis",
        Right(NAMED, "stenosis"),
        thinned(30, 1e-3),
        _std(1e-3),
    ),
    "again": Row("stamps begin again at 0 in mid-log", "pull", None, Right((), words="increase", stops=True), again),
    "lag": Row("lag of the drive, 100 Hz, 0.5 mm", "magnetic", "actuator_lag", LAG, thinned(100, 5e-4), _std(5e-4)),
    "lag_unstated": Row("the same, noise not stated", "magnetic", "actuator_lag", LAG, thinned(100, 5e-4), _unstated),
    "play": Row(
        "play, 100 Hz, 0.3 mm",
        "magnetic",
        "carriage_backlash",
        Right(NAMED, "carriage_backlash"),
        thinned(100, 3e-4),
        _std(3e-4),
    ),
    "poor": Row("noise of 4 mN where 1 mN is stated", "pull", None, Right(NONE, words="noise"), poor, rate_Hz=5000.0),
}
SERIES: Final = {
    "lag": "magnetic_lag", "lag_unstated": "magnetic_lag", "slow": "magnetic_none", "slow_narrow": "magnetic_stenosis",
    "sign": "pull_none", "clipped": "pull_none", "late": "pull_none",
    "again": "pull_none",
}  # fmt: skip
"""Shared series that a row's fault is put on with `--shared`."""


def made(row: Row, seed: int, seconds: float, folder: Path, shared: Path | None) -> None:
    """The row's spoiled series in `folder`."""
    clean = folder / "clean" if shared is None else shared
    if shared is None:
        make_series(row.kind, row.effect, 1000 + seed, clean, seconds, row.noise, row.rate_Hz)
    rng = np.random.default_rng(seed)
    for name in NAMES:
        table = np.genfromtxt(clean / f"{name}.csv.gz", delimiter=",", names=True)
        columns = {column: table[column] for column in table.dtype.names or ()}
        write_record(folder / f"{name}.csv.gz", columns if row.spoil is None else row.spoil(columns, rng))
    (folder / "rig.toml").write_text(row.rig((clean / "rig.toml").read_text()))


def said(folder: Path) -> dict[str, Any]:
    """What `close-loop` says of the series, and how it ended."""
    kept = folder / "said.json"
    if kept.exists():
        return dict(json.loads(kept.read_text()))
    shutil.rmtree(folder / "out", ignore_errors=True)
    records = [str(folder / f"{name}.csv.gz") for name in NAMES]
    command = [sys.executable, "-m", "hil.app.start", "close-loop", *records[:3], "--holdout", records[3]]
    command += ["--rig", str(folder / "rig.toml"), "--out", str(folder / "out"), "--json"]
    begun = time.monotonic()
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    report = json.loads(ended.stdout) if ended.returncode != 2 else {}  # with 2 it is the sentence of an error
    result = {"status": ended.returncode, "sentence": ended.stderr[-2000:], "report": report}
    result["seconds"] = time.monotonic() - begun
    kept.write_text(json.dumps(result))
    return result


def right(row: Right, result: dict[str, Any]) -> bool:
    """Whether what was said is right."""
    report = result["report"]
    words = json.dumps(report.get("findings", [])) + json.dumps(report.get("reasons", [])) + result["sentence"]
    if row.words and not re.search(row.words, words, re.IGNORECASE):
        return False
    if row.stops:
        return result["status"] != 0
    effects = [(e["id"], *e["equivalent"]) for e in report.get("effects", [])]
    if report.get("verdict") not in row.verdicts:
        return False
    return row.effect is None or (len(effects) == 1 and row.effect in effects[0])


def line(name: str, row: Row, seed: str, result: dict[str, Any]) -> str:
    """The series' row of the table."""
    report = result["report"]
    effects = ", ".join(
        "/".join((e["id"], *e["equivalent"])) + f" {e['confidence_score']:.3f}" for e in report.get("effects", [])
    )
    heads = "; ".join(f"{f['severity']}: {f['sentence']}" for f in report.get("findings", []))[:160]
    heads = heads or result["sentence"].strip().splitlines()[-1][:160] if not report else heads
    error = report.get("error", {})
    floor = error.get("noise_floor") or float("nan")
    steps = [error.get("holdout", {}).get(step) for step in ("calibrated", "augmented")]
    score = " -> ".join(f"{value / floor:.2f}" for value in steps if value is not None)
    mark = "right" if right(row.right, result) else "WRONG"
    verdict = report.get("verdict", f"status {result['status']}")
    return f"| {row.what} | {seed} | {mark} | {verdict} {effects} | {heads} | {score} | {result['seconds']:.0f} s |"


def main() -> None:
    """Make and run what is missing, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", choices=[*ROWS, []], default=[])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=45.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--shared", action="store_true", help="put the faults on the shared series, too")
    asked = parser.parse_args()
    jobs: list[tuple[str, Row, str, Path]] = []
    for name in asked.rows or ROWS:
        row = ROWS[name]
        for seed in range(asked.seeds):
            folder = asked.out / f"{name}_{seed}"
            if not (folder / "rig.toml").exists():
                folder.mkdir(parents=True, exist_ok=True)
                made(row, seed, asked.seconds, folder, None)
            jobs.append((name, row, str(seed), folder))
        if asked.shared and name in SERIES:
            folder = asked.out / f"{name}_shared"
            if not (folder / "rig.toml").exists():
                folder.mkdir(parents=True, exist_ok=True)
                made(row, 0, asked.seconds, folder, SHARED / "reference" / "series" / SERIES[name])
            jobs.append((name, row, SERIES[name], folder))
    with ThreadPoolExecutor(asked.workers) as pool:
        results = list(pool.map(lambda job: said(job[3]), jobs))
    print("| record | seed | | said | findings | held out | time |\n| --- | --- | --- | --- | --- | --- | --- |")
    for (name, row, seed, _), result in zip(jobs, results, strict=True):
        print(line(name, row, seed, result))
    count = sum(right(row.right, result) for (_, row, _, _), result in zip(jobs, results, strict=True))
    print(f"\n{count} of {len(jobs)} right")


if __name__ == "__main__":
    main()
