"""Sets of nonlinearbenchmark.org: free-run errors of what the closed loop finds, beside the published ones.

`python -m tests.bench.bench_nonlinear [FOLDER ...] [--held-out] [--seed 0] [--out FILE]` prints the error of each stage
on the training records, with `--held-out` on the test records too, which no fit sees: EMPS without a FOLDER. A FOLDER
holds `rig.toml`, records `train*.csv` and `test*.csv` of input and output (the rig file's `[columns]` may name them),
and, where known, `published.toml`: `start_samples` that a model may begin with, and under `[error]` what others reach.
"""

import argparse
import json
import time
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from models.identification import Model, close
from models.records.record import Record, read_record
from models.rigs.reader import parse_rig, read_rig
from models.rigs.rig import Rig
from tests.places import SHARED

EMPS_PUBLISHED = {
    "error": {
        "four numbers by least squares (Janot et al. 2019)": 4.7e-3,
        "networks": 74e-3,
        "dynoNet (Forgione, Piga 2021)": 2.64e-3,
    },
    "start_samples": 20,
}


@dataclass(frozen=True)
class BenchmarkSet:
    """One set: the rig, its records, and what is published about it."""

    name: str
    rig: Rig
    train: list[Record]
    test: list[Record]
    published: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def emps(cls) -> "BenchmarkSet":
        rig, folder = parse_rig({"rig": {"kind": "axis", "driven": "force_N"}}), SHARED / "data" / "emps"
        train, test = (read_record(folder / f"{name}.csv", rig) for name in ("train", "test_pulses"))
        return cls("EMPS", rig, [train], [test], EMPS_PUBLISHED)

    @classmethod
    def of(cls, folder: Path) -> "BenchmarkSet":
        """The set in a folder."""
        rig, told = read_rig(folder / "rig.toml"), folder / "published.toml"
        train, test = (
            [read_record(path, rig) for path in sorted(folder.glob(f"{part}*.csv*"))] for part in ("train", "test")
        )
        return cls(folder.name, rig, train, test, tomllib.loads(told.read_text()) if told.exists() else {})

    def error(self, model: Model, records: list[Record], stage: str) -> float:
        """Rms of the free run after the samples that a model may begin with, in the measured column's unit."""
        off = []
        for record in records:
            predicted = model.predict(self.rig, record, stage)
            (column,) = record.layout.measured
            off.append((record[column] - predicted[column])[int(self.published.get("start_samples", 0)) :])
        return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def figures(one: BenchmarkSet, seed: int, held_out: bool) -> dict[str, Any]:
    """What is found on the training records, and its errors."""
    began = time.process_time()
    finding, model = close(one.rig, one.train, [], lambda *_: None, seed=seed)
    parts = {"train": one.train, **({"test": one.test} if held_out else {})}
    errors = {part: {stage: one.error(model, some, stage) for stage in model.stages} for part, some in parts.items()}
    return {
        "set": one.name,
        "column": finding.quantity,
        "verdict": finding.verdict,
        "effects": [effect.id for effect in finding.effects],
        "error": errors,
        "published": dict(one.published.get("error", {})),
        "processor_seconds": round(time.process_time() - began, 1),
    }


def main() -> None:
    """Print the figures of each set, and write them as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--held-out", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows = []
    for one in map(BenchmarkSet.of, options.folders) if options.folders else (BenchmarkSet.emps(),):
        row = figures(one, options.seed, options.held_out)
        rows.append(row)
        print(
            f"{row['set']}: {row['verdict']}, {', '.join(row['effects']) or 'no effect'}, {row['processor_seconds']} s"
        )
        for part, errors in row["error"].items():
            print(f"  {part}: " + ", ".join(f"{stage} {error:.4g}" for stage, error in errors.items()), row["column"])
        for name, error in row["published"].items():
            print(f"  published, test: {error:.4g}  {name}")
    if options.out:
        options.out.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
