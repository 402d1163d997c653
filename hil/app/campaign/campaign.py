"""`capsule campaign`: thousands of closed loops, or `close-loop` on many series, resumed after an interruption."""

import io
import json
import shlex
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.table import Table

from hil.app.campaign.file import METRICS, Campaign, load_campaign
from hil.app.campaign.page import Runs, page_html, unsafe, value_of
from hil.app.campaign.running import Results, run_missing
from hil.app.campaign.series import find_series
from hil.app.campaign.series_answers import TEXT, SeriesAnswer, answer_of, lacking, verdicts, with_disagreements
from hil.app.campaign.series_answers import document as answers_document
from hil.app.campaign.series_page import page_html as answers_html
from hil.app.campaign.worker import PASSING, Row, run_job
from hil.app.cluster import Workers, program_version
from hil.app.console import answer, json_text, note, output_to_notes, print_json, text_table
from hil.app.shared_options import MOST_SEED, Json, OwnEffects, Scheduler, WorkerCount, argument, option
from hil.app.write import check_targets, own_folder, write_files
from hil.report.words import column_words
from models.effects import Catalogue
from models.words.quantities import plain, quantity

RESULTS, TABLE, PAGE, NUMBERS = "results.jsonl", "results.parquet", "campaign.html", "campaign.json"
REPORTS: Final = "series"
SERIES_LIMIT_S: Final = 6 * 3600.0  # longest close-loop of a series
_SHOWN: Final = 5  # worst cases that the terminal shows
_FAILED_RUNS: Final = 5  # that are listed of each error
_MARK: Final = "close-loop over folders"  # Marks the results of series; each series has a hash of its own
Outcome = tuple[dict[str, Any], Sequence[str | Table], bool]
"""The numbers, the lines for the terminal, and whether a run failed."""


def campaign(
    paths: Annotated[list[Path], argument("CAMPAIGN.toml|FOLDER")],
    *,
    out: Annotated[Path, option("--out", "DIR")] = Path("out/campaign"),
    workers: WorkerCount = None,
    scheduler: Scheduler = None,
    run: Annotated[int | None, option("--run", "N")] = None,
    retry: Annotated[bool, typer.Option("--retry")] = False,
    json_output: Json = False,
    seed: Annotated[int, typer.Option("--seed", metavar="N", min=0, max=MOST_SEED)] = 0,
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
        check_targets([out / name for name in (PAGE, NUMBERS, TABLE)], "--out", paths)
        plan = None if over_series else load_campaign(paths[0])
        if plan is not None and run is not None:
            return _one(plan, run)
        on = Workers(workers, scheduler)
        if plan is not None:
            command = shlex.join(["capsule", "campaign", str(paths[0])])
            found, lines, failed = _loops(plan, out, command, on, retry=retry)
        else:
            found, lines, failed = _series(paths, out, own, seed, on, retry=retry)
    answer(json_output, found, *lines, TEXT("report", path=found["report"]))
    return int(failed)


def _loops(plan: Campaign, out: Path, repeat: str, on: Workers, *, retry: bool) -> Outcome:
    with Results(out / RESULTS, plan.fingerprint, program_version(), retry=retry) as results:
        resumed = len(results.done)

        def show() -> tuple[Runs, dict[str, Any]]:
            runs = Runs(results.rows(), plan.head.metric, list(plan.draws))
            found = document(plan, runs, repeat) | {"resumed": resumed, "report": str(out / PAGE)}
            page = page_html(plan.name, runs, repeat, len(plan), program_version())
            write_files({out / PAGE: page, out / NUMBERS: json_text(found)})
            return runs, found

        run_missing(
            plan.name, range(len(plan)), plan.job, results, plan.head.chunk, on, shown=show, limit_s=plan.head.limit_s
        )
        runs, found = show()
        found["table"] = write_table(out / TABLE, results.rows())
    metric = plan.head.metric
    words, unit = column_words(metric)
    counts, sizes = ("runs", "failed", "unsafe", "hard_violations"), ("median", "p95", "max")
    table = text_table("", ("", *(head.replace("_", " ") for head in counts), *sizes), bare=True)
    for name, numbers in found["groups"].items():
        cells = (quantity(numbers[head], unit) for head in sizes)
        table.add_row(name, *(str(numbers[head]) for head in counts), *cells)
    failed = [TEXT("failed", **one) for one in found["failures"]]
    worst = [TEXT("worst", value=quantity(one["value"], unit), repeat=one["repeat"]) for one in found["worst"]]
    head = TEXT("head", name=plan.name, runs=len(plan), resumed=resumed, metric=words)
    return found, [head, table, *failed, *worst[:_SHOWN]], bool(runs.failures)


def document(plan: Campaign, runs: Runs, repeat: str) -> dict[str, Any]:
    """The campaign's numbers: all runs, groups, errors, and the worst cases with the command that repeats each."""
    metric = plan.head.metric
    return {
        "campaign": plan.name,
        "engine": plan.head.engine,
        "metric": metric,
        "runs": len(plan),
        "missing": len(plan) - len(runs),
        "version": program_version(),
        "all": runs.summary(),
        "groups": {name: runs.summary(which) for name, which in runs.groups().items()},
        "failures": [
            {"error": error, "count": len(those), "runs": those[:_FAILED_RUNS], "repeat": f"{repeat} --run {those[0]}"}
            for error, those in runs.failures.items()
        ],
        "worst": [
            {"run": row["run"], "value": value_of(row, metric), "point": row["point"]}
            | {"repeat": f"{repeat} --run {row['run']}"}
            for row in runs.worst
        ],
        "seconds_of_runs": runs.seconds,
    }


def _one(plan: Campaign, number: int) -> int:
    if not 0 <= number < len(plan):
        raise ValueError(f"--run must lie in [0, {len(plan) - 1}]; got {number}")
    with output_to_notes():
        row = run_job(plan.job(number))
    print_json({key: value for key, value in row.items() if key not in PASSING})
    return 1 if "error" in row else 0


def _series(
    paths: Sequence[Path], out: Path, effects: Sequence[Path], seed: int, on: Workers, *, retry: bool
) -> Outcome:
    Catalogue.read(effects)  # before any series begins
    jobs = {job.number: job for job in find_series(paths, out / REPORTS, effects, seed)}
    with Results(out / RESULTS, _MARK, program_version(), retry=retry) as results:
        for row in list(results.rows()):
            if "result" in row and (job := jobs.get(row["run"])) is not None and not job.reported:
                results.drop(row["run"])
        resumed = sum(number in results.done for number in jobs)

        def show() -> tuple[list[SeriesAnswer], dict[str, Any]]:
            rows = {row["run"]: row for row in results.rows()}
            answers = with_disagreements(
                [answer_of(job.name, rows[n], f"{REPORTS}/{job.name}") for n, job in jobs.items() if n in rows]
            )
            version, missing = program_version(), len(jobs) - len(answers)
            found = answers_document(answers) | {"missing": missing, "version": version, "resumed": resumed}
            found["report"] = str(out / PAGE)
            write_files({out / PAGE: answers_html(answers, missing, version), out / NUMBERS: json_text(found)})
            return answers, found

        run_missing(
            "campaign", list(jobs), jobs.__getitem__, results, 1, on, _said, show,
            lambda row: jobs[row["run"]].keep(row.get("files", {})), SERIES_LIMIT_S,
        )  # fmt: skip
        answers, found = show()
        found["table"] = write_table(out / TABLE, (row for row in results.rows() if row["run"] in jobs))
    return found, _lines(answers, resumed), any(answer.error for answer in answers)


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
    for one in answers:
        lines += [TEXT("disagrees", series=one.name, sentence=sentence) for sentence in one.disagrees]
        lines += [TEXT("refused", series=one.name, error=one.error)] * bool(one.error)
    return lines


_TEXTS: Final = ("run", "version", "error", "cause", "verdict", "point")
_BATCH: Final = 10_000  # rows that are held at once


def write_table(path: Path, rows: Iterable[Row]) -> str:
    """Write the rows; the file's name, "" where pyarrow is missing. `point` is JSON; the numbers of `Score` are empty
    in the rows of series, and `verdict` in those of loops.
    """
    if find_spec("pyarrow") is None:
        note(TEXT("no_table", path=str(path)))
        return ""
    import pyarrow
    import pyarrow.parquet

    kinds = dict.fromkeys(_TEXTS, pyarrow.string()) | {"seed": pyarrow.int64(), "unsafe": pyarrow.bool_()}
    schema = pyarrow.schema(kinds | dict.fromkeys(("seconds", *METRICS), pyarrow.float64()))
    cells, sink = map(_cells, rows), io.BytesIO()
    with pyarrow.parquet.ParquetWriter(sink, schema, compression="zstd") as writer:
        while batch := list(islice(cells, _BATCH)):
            writer.write_table(pyarrow.Table.from_pylist(batch, schema))
    write_files({path: sink.getvalue()})
    return str(path)


def _cells(row: Row) -> dict[str, Any]:
    result = row.get("result", {})
    numbers = {name: value for name in METRICS if isinstance(value := result.get(name), int | float)}
    texts = {name: row.get(name) for name in ("version", "error", "cause")} | {"verdict": result.get("verdict")}
    point = json.dumps(plain(dict(row["point"])))
    own = {"run": str(row["run"]), "seed": row["seed"], "seconds": row.get("seconds"), "point": point}
    return own | texts | {"unsafe": unsafe(row)} | numbers
