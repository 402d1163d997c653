"""`capsule campaign FOLDER...`: `close-loop` on many series, resumed where it was cut off, and one page of them all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from hil.app.campaign.folders.agreement import with_disagreements
from hil.app.campaign.folders.answers import Answer, answer_of, document, lacking, verdicts
from hil.app.campaign.folders.page import page_html
from hil.app.campaign.folders.series import find_series
from hil.app.campaign.results import Results
from hil.app.campaign.running import check_workers, run_missing
from hil.app.campaign.worker import Row
from hil.app.console import json_text, print_json, summary
from hil.app.write import write_files
from models.effects import use_effects

RESULTS, PAGE, NUMBERS, REPORTS = "results.jsonl", "campaign.html", "campaign.json", "series"
_MARK: Final = "close-loop over folders"
"""What the results of such a campaign are known by; a series is known by a hash of its own."""


def folders(
    paths: Sequence[Path],
    out: Path,
    *,
    effects: Sequence[Path] = (),
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    json_output: bool = False,
) -> int:
    """Close the loop on each series in the folders `paths` that the folder `out` does not hold yet; write
    `campaign.html`, `campaign.json` and each series' report below `series`.

    1 where a series could not be used, else 0. Raises ValueError of one sentence.
    """
    check_workers(workers, scheduler)
    use_effects(effects)
    jobs = find_series(paths, out / REPORTS, effects, seed)
    results = Results(out / RESULTS, _MARK)
    try:
        for job in jobs:
            if not job.reported and "result" in results.done.get(job.number, {}):
                del results.done[job.number]
        resumed = sum(job.number in results.done for job in jobs)
        rows = run_missing("campaign", jobs, results, 1, workers, scheduler, _said)
    finally:
        results.close()
    answers = with_disagreements(
        [answer_of(job.name, row, f"{REPORTS}/{job.name}") for job, row in zip(jobs, rows, strict=True)]
    )
    found = document(answers) | {"resumed": resumed, "report": str(out / PAGE)}
    write_files({out / PAGE: page_html(answers), out / NUMBERS: json_text(found)})
    if json_output:
        print_json(found)
    else:
        _show(answers, found)
    return 1 if any(answer.error for answer in answers) else 0


def _said(row: Row) -> str:
    told = "refused" if "error" in row else row["result"]["verdict"]
    return f"{row['point']['series']}: {told}"


def _show(answers: Sequence[Answer], found: dict[str, Any]) -> None:
    console = summary()
    counts = ", ".join(f"{count} {verdict}" for verdict, count in verdicts(answers).items() if count)
    console.print(f"{len(answers)} series, {found['resumed']} of them done before: {counts}", markup=False)
    table = Table(box=None, pad_edge=False)
    for head in ("", "named by", "a part in"):
        table.add_column(head, justify="right" if head else "left")
    for effect, named, part in lacking(answers):
        table.add_row(effect, str(named), str(part))
    if table.row_count:
        console.print(table)
    for answer in answers:
        for sentence in answer.disagrees:
            console.print(f"{answer.name} disagrees with {sentence}", markup=False, soft_wrap=True)
        if answer.error:
            console.print(f"{answer.name} refused: {answer.error}", markup=False, soft_wrap=True)
    console.print(f"report: {found['report']}", markup=False, soft_wrap=True)
