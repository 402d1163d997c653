"""Another simulator's series: what the loop finds in them, what it leaves, how long it takes.

`python -m tests.bench.bench_series FOLDER --out DIR [--names a b]` runs `capsule close-loop` on every series in FOLDER
(training records, a hold-out, a rig file and `answer.toml` each), keeps what is done and prints a line a series. "True
base" is the held-out error of the same model with its base numbers as the answer tells them and the effect's own fitted
to the training records.
"""

import argparse
import json
import tomllib
from dataclasses import replace
from pathlib import Path

from models.identification.fitting.fitter import Fitter
from tests.bench.bench_tracing import close_series, read_series

_HEADER = (
    "series | told | verdict | named | nominal | calibrated | augmented | floor | true base | base within intervals | s"
)


def line(folder: Path, out: Path) -> str:
    """What one series gave, its errors in the unit of what is measured."""
    close_series(folder, out)
    kind, train, holdout, found = read_series(folder, out)
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    answer = tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    told = {name: float(value) for name, value in answer.items() if name in report["calibration"]}
    base = tuple(replace(p, value=told[p.name], fit=False) if p.name in told else p for p in kind.base)
    held = replace(kind, base=base)
    effects = tuple(sorted(found.effects))
    start = found | told
    fitter = Fitter.of(held, train, effects)
    true = start | fitter.exactly(fitter.far([start]).theta).theta
    left = kind.error(holdout, [kind.predict(record, true) for record in holdout])
    within = all(
        low <= value <= high for name, value in told.items() for low, high in [report["calibration"][name]["ci95"]]
    )
    errors = report["error"]["holdout"]
    named = ", ".join(" or ".join([e["id"], *e["equivalent"]]) for e in report["effects"]) or "-"
    numbers = [errors["nominal"], errors["calibrated"], errors["augmented"], report["error"]["noise_floor"], left]
    cells = [
        answer["effect"],
        report["verdict"],
        named,
        *(f"{n:.3g}" for n in numbers),
        within,
        f"{report['seconds']:.0f}",
    ]
    return " | ".join(str(cell) for cell in [folder.name, *cells])


def main() -> None:
    """Close what is not closed yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--names", nargs="*")
    arguments = parser.parse_args()
    print(_HEADER)
    for answer in sorted(arguments.folder.glob("*/answer.toml")):
        name = answer.parent.name
        if arguments.names is None or name in arguments.names:
            print(line(answer.parent, arguments.out / name), flush=True)


if __name__ == "__main__":
    main()
