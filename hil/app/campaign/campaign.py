"""`capsule campaign`: thousands of closed loops, or `close-loop` on many series, resumed after an interruption."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.table import Table

from hil.app.campaign.file import Campaign, load_campaign
from hil.app.campaign.page import groups, page_html, summary_of, value_of, worst_of
from hil.app.campaign.running import Results, Workers, run_missing
from hil.app.campaign.series import find_series
from hil.app.campaign.series_answers import TEXT, SeriesAnswer, answer_of, lacking, verdicts, with_disagreements
from hil.app.campaign.series_answers import document as answers_document
from hil.app.campaign.series_page import page_html as answers_html
from hil.app.campaign.worker import Row, run_job
from hil.app.console import json_text, output_to_notes, print_json, summary, text_table
from hil.app.shared_options import MOST_SEED, Json, OwnEffects, argument, option
from hil.app.write import own_folder, write_files
from hil.report.words import column_words
from models.effects import Catalogue
from models.words.quantities import quantity

RESULTS, PAGE, NUMBERS, REPORTS = "results.jsonl", "campaign.html", "campaign.json", "series"
_SHOWN: Final = 5  # worst cases that the terminal shows
_MARK: Final = "close-loop over folders"
"""Marks the results of series; each series has a hash of its own."""
Outcome = tuple[str, dict[str, Any], Sequence[str | Table], bool]
"""The page, the numbers, the lines for the terminal, and whether a run failed."""


def campaign(
    paths: Annotated[
        list[Path],
        argument(
            "CAMPAIGN.toml | FOLDER...",
            "A scenario and what is varied in it; or folders of series, rig.toml and records in each.",
        ),
    ],
    *,
    out: Annotated[
        Path, option("--out", "DIR", "Folder for results and report; a campaign there is continued.")
    ] = Path("out/campaign"),
    workers: Annotated[int | None, option("--workers", "N", "Number of processes; else one per core.")] = None,
    scheduler: Annotated[str | None, option("--scheduler", "ADDRESS", "A Dask scheduler to run on.")] = None,
    run: Annotated[int | None, option("--run", "N", "Do run N alone and print it.")] = None,
    json_output: Json = False,
    seed: Annotated[
        int, typer.Option("--seed", min=0, max=MOST_SEED, help="For folders: sets every random number.")
    ] = 0,
    own: OwnEffects,
) -> int:
    """Do the open runs of a campaign file, or close the loop on each series in the folders. Write `campaign.html` and
    `campaign.json`, and each series' report below `series`. Status 1 where a run failed, else 0.
    """
    over_series = len(paths) > 1 or paths[0].is_dir()
    if not over_series and (own or seed):
        raise ValueError("--effects and --seed must be left out with a campaign file, which has its own seed")
    if over_series and run is not None:
        raise ValueError("--run must be left out with folders: close-loop does one series alone")
    with own_folder(out if run is None else None, "--out"):
        plan = None if over_series else load_campaign(paths[0])
        if plan is not None and run is not None:
            return _one(plan, run)
        on = Workers(workers, scheduler)
        if plan is not None:
            page, found, lines, failed = _loops(plan, out, shlex.join(["capsule", "campaign", str(paths[0])]), on)
        else:
            page, found, lines, failed = _series(paths, out, own, seed, on)
        found["report"] = str(out / PAGE)
        write_files({out / PAGE: page, out / NUMBERS: json_text(found)})
    if json_output:
        print_json(found)
    else:
        for line in (*lines, TEXT("report", path=found["report"])):
            summary().print(line, soft_wrap=isinstance(line, str))
    return int(failed)


def _loops(plan: Campaign, out: Path, repeat: str, on: Workers) -> Outcome:
    with Results(out / RESULTS, plan.fingerprint) as results:
        resumed = len(results.done)
        jobs = [plan.job(number) for number in range(len(plan))]
        rows = run_missing(plan.name, jobs, results, plan.head.chunk, on)
    metric = plan.head.metric
    found = document(plan, rows, repeat) | {"resumed": resumed}
    words, unit = column_words(metric)
    counts, sizes = ("runs", "failed", "unsafe", "hard_violations"), ("median", "p95", "max")
    table = text_table("", ("", *(head.replace("_", " ") for head in counts), *sizes), bare=True)
    for name, numbers in found["groups"].items():
        cells = (quantity(numbers[head], unit) for head in sizes)
        table.add_row(name, *(str(numbers[head]) for head in counts), *cells)
    worst = [TEXT("worst", value=quantity(one["value"], unit), repeat=one["repeat"]) for one in found["worst"][:_SHOWN]]
    head = TEXT("head", name=plan.name, runs=len(plan), resumed=resumed, metric=words)
    page = page_html(plan.name, metric, rows, list(plan.draws), repeat)
    return page, found, [head, table, *worst], any("error" in row for row in rows)


def document(plan: Campaign, rows: list[Row], repeat: str) -> dict[str, Any]:
    """The campaign's numbers: all runs, each combination, and the worst cases with the command that repeats each."""
    metric = plan.head.metric
    return {
        "campaign": plan.name,
        "engine": plan.head.engine,
        "metric": metric,
        "all": summary_of(rows, metric),
        "groups": {name: summary_of(part, metric) for name, part in groups(rows, list(plan.draws)).items()},
        "worst": [
            {"run": row["run"], "value": value_of(row, metric), "point": row["point"]}
            | {"repeat": f"{repeat} --run {row['run']}"}
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


def _series(paths: Sequence[Path], out: Path, effects: Sequence[Path], seed: int, on: Workers) -> Outcome:
    Catalogue.read(effects)  # before any series begins
    jobs = find_series(paths, out / REPORTS, effects, seed)
    with Results(out / RESULTS, _MARK) as results:
        for job in jobs:
            if not job.reported and "result" in results.done.get(job.number, {}):
                del results.done[job.number]
        resumed = sum(job.number in results.done for job in jobs)
        rows = run_missing("campaign", jobs, results, 1, on, _said)
    answers = with_disagreements(
        [answer_of(job.name, row, f"{REPORTS}/{job.name}") for job, row in zip(jobs, rows, strict=True)]
    )
    found = answers_document(answers) | {"resumed": resumed}
    return answers_html(answers), found, _lines(answers, resumed), any(answer.error for answer in answers)


def _said(row: Row) -> str:
    verdict = "refused" if "error" in row else row["result"]["verdict"]
    return f"{row['point']['series']}: {verdict}"


def _lines(answers: Sequence[SeriesAnswer], resumed: int) -> list[str | Table]:
    counts = ", ".join(f"{count} {verdict}" for verdict, count in verdicts(answers).items() if count)
    lines: list[str | Table] = [TEXT("series_head", count=len(answers), resumed=resumed, counts=counts)]
    table = text_table("", ("", "named in", "partly in"), bare=True)
    for effect, named, part in lacking(answers):
        table.add_row(effect, str(named), str(part))
    lines += [table] * bool(table.row_count)
    for answer in answers:
        lines += [TEXT("disagrees", series=answer.name, sentence=sentence) for sentence in answer.disagrees]
        lines += [TEXT("refused", series=answer.name, error=answer.error)] * bool(answer.error)
    return lines
