"""What is said of series that a search has once named wrongly: verdict, names, checks with limits, held-out error.

`python -m tests.bench.bench_wrong_names --out DIR [CASE...]` makes each case of
`tests.models.identification.wrong_names`, runs `capsule close-loop` on it and prints a table. What is on file in DIR is
not run again. Right is whatever names no effect that is not there.
"""

import argparse
import contextlib
import io
import json
from pathlib import Path
from typing import Any

from hil.app.main import run as capsule
from tests.models.identification.wrong_names import CASES, Case


def closed(case: Case, folder: Path) -> dict[str, Any]:
    """The report on the case in `folder`."""
    kept = folder / "out" / "report.json"
    if not kept.exists():
        records = [str(path) for path in case.make(folder)]
        held = [str(path) for path in (folder / "holdout.csv.gz",) if path.exists()]
        words = ["--rig", str(folder / "rig.toml"), "--out", str(folder / "out"), "--json"]
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
            if capsule(["close-loop", *records, *(word for path in held for word in ("--holdout", path)), *words]):
                raise RuntimeError(f"close-loop refused {folder}: {said.getvalue()}")
    return dict(json.loads(kept.read_text(encoding="utf-8")))


def right(case: Case, report: dict[str, Any]) -> bool:
    """Whether no effect is named that is not there."""
    named = [{one["id"], *one["equivalent"]} for one in report["effects"]]
    return report["verdict"] != "named" or all(names & set(case.right) for names in named)


def line(name: str, case: Case, report: dict[str, Any]) -> str:
    """The case's row of the table."""
    names = ", ".join("/".join((one["id"], *one["equivalent"])) for one in report["effects"]) or "-"
    floor = report["error"]["noise_floor"] or float("nan")
    part = "train" if report["error"]["holdout"]["augmented"] is None else "holdout"
    steps = [report["error"][part][stage] / floor for stage in ("calibrated", "augmented")]
    failed = "; ".join(f"{c['id']} {c['value']:.3g} > {c['limit']:.3g}" for c in report["checks"] if not c["ok"]) or "-"
    mark = "right" if right(case, report) else "WRONG"
    floors = " -> ".join(f"{step:.2f}" for step in steps)
    return (
        f"| {name} | {mark} | {report['verdict']} | {names} | {failed} | {floors} ({part}) | {report['seconds']:.0f} |"
    )


def main() -> None:
    """Run what is missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", choices=[*CASES, []], default=[])
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    print("| case | | verdict | names | failed checks | floors | s |\n| --- | --- | --- | --- | --- | --- | --- |")
    for name in asked.cases or CASES:
        print(line(name, CASES[name], closed(CASES[name], asked.out / name)), flush=True)


if __name__ == "__main__":
    main()
