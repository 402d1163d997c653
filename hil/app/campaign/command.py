"""`capsule campaign`: thousands of closed loops, resumed where they were cut off, and what came of them."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from hil.app.campaign.file import Campaign, load_campaign
from hil.app.campaign.page import groups, page_html, summary_of, value_of, worst_of
from hil.app.campaign.results import Results
from hil.app.campaign.running import check_workers, run_missing
from hil.app.campaign.worker import Row, run_job
from hil.app.console import json_text, output_to_notes, print_json, summary
from hil.app.quantities import number
from hil.app.write import write_files

RESULTS, PAGE, NUMBERS = "results.jsonl", "campaign.html", "campaign.json"
_SHOWN: Final = 5


def campaign(
    path: Path,
    out: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    run: int | None = None,
    json_output: bool = False,
) -> int:
    """Do the runs of the campaign file `path` that the folder `out` does not hold yet, and write `campaign.html` and
    `campaign.json`.

    With `run` that one run alone is done and printed. 1 where a run failed, else 0. Raises ValueError of one sentence.
    """
    plan = load_campaign(path)
    if run is not None:
        return _one(plan, run)
    check_workers(workers, scheduler)
    results = Results(out / RESULTS, plan.fingerprint)
    jobs = [plan.job(number) for number in range(len(plan))]
    try:
        resumed = len(results.done)
        rows = run_missing(plan.name, jobs, results, plan.head.chunk, workers, scheduler)
    finally:
        results.close()
    repeat = shlex.join(["capsule", "campaign", str(path)])
    found = document(plan, rows, repeat) | {"resumed": resumed, "report": str(out / PAGE)}
    page = page_html(plan.name, plan.head.metric, rows, list(plan.draws), repeat)
    write_files({out / PAGE: page, out / NUMBERS: json_text(found)})
    if json_output:
        print_json(found)
    else:
        _say(plan, found)
    return 1 if any("error" in row for row in rows) else 0


def document(plan: Campaign, rows: list[Row], repeat: str) -> dict[str, Any]:
    """The campaign's numbers: of all runs, of each combination, and its worst cases with the command that repeats
    each.
    """
    metric = plan.head.metric
    return {
        "campaign": plan.name,
        "engine": plan.head.engine,
        "metric": metric,
        "all": summary_of(rows, metric),
        "groups": {name: summary_of(part, metric) for name, part in groups(rows, list(plan.draws)).items()},
        "worst": [
            {
                "run": row["run"],
                "value": value_of(row, metric),
                "point": row["point"],
                "repeat": f"{repeat} --run {row['run']}",
            }
            for row in worst_of(rows, metric)
        ],
        "seconds_of_runs": sum(row.get("seconds", 0.0) for row in rows),
    }


def _one(plan: Campaign, number: int) -> int:
    if not 0 <= number < len(plan):
        raise ValueError(f"--run must lie in [0, {len(plan) - 1}]; got {number}")
    with output_to_notes():
        row = run_job(plan.job(number))
    print_json(row)
    return 1 if "error" in row else 0


def _say(plan: Campaign, found: dict[str, Any]) -> None:
    console, metric = summary(), plan.head.metric
    console.print(f"{plan.name}: {len(plan)} runs, {found['resumed']} of them done before; {metric}", markup=False)
    table = Table(box=None, pad_edge=False)
    heads = ("", "runs", "failed", "unsafe", "hard_violations", "median", "p95", "max")
    for head in heads:
        table.add_column(head, justify="right" if head else "left")
    for name, numbers in found["groups"].items():
        table.add_row(name, *(number(numbers[head]) for head in heads[1:]))
    console.print(table)
    for one in found["worst"][:_SHOWN]:
        console.print(f"worst: {number(one['value'])}  {one['repeat']}", markup=False, soft_wrap=True)
    console.print(f"report: {found['report']}", markup=False, soft_wrap=True)
