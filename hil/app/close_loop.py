"""`capsule close-loop`: measured records in; report, numbers and the better model out."""

import hashlib
import math
import os
import signal
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

from rich.table import Table

from hil.app import console
from hil.app import shared_options as options
from hil.app.cluster import Workers, program_version, spread
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import argument, option, several
from hil.app.write import check_targets, sole_writer, table_text, write_files
from hil.log.rig_record import read_rig_record
from hil.report.closed_loop import report_html
from hil.report.figure_residuals import dependence_words
from hil.report.numbers import report_json
from hil.report.words import PARTS, confidence_words, disagreement_words, error_cells, error_scale, grouped, headline
from models.effects import Catalogue, effect_words
from models.files.access import cache_folder, opened, private_folder
from models.files.toml import toml_text
from models.identification import Model, close
from models.identification.finding import NEXT_CSV, NEXT_TOML, STAGES, Finding, Proposal
from models.records.record import Record
from models.rigs.rig import Rig
from models.words.sentences import Quantity, Sentences
from models.workers import keeping

TEXT: Final = Sentences(__file__)
REPORT, NUMBERS, MODEL = "report.html", "report.json", "model.toml"
FILES = (REPORT, NUMBERS, MODEL, NEXT_TOML, NEXT_CSV)
_MM = 1e3  # in a metre
_KEPT_S = 30 * 86400.0  # for which an interrupted search can go on


def close_loop(
    records: Annotated[list[Path], argument("RECORD", reads="record")],
    rig: options.RigFile,
    out: Annotated[Path, option("--out", "DIR")],
    holdout: Annotated[list[Path], several("--holdout", "RECORD...", reads="record")],
    *,
    budget: Annotated[str | None, option("--budget", "TIME")] = None,
    workers: options.WorkerCount = None,
    scheduler: options.Scheduler = None,
    json_output: options.Json = False,
    seed: options.Seed = 0,
    effects: options.OwnEffects,
) -> None:
    """Find what the model lacks and write all files or none. SIGTERM ends it like Ctrl-C."""
    on, budget_s = Workers(workers, scheduler), math.inf if budget is None else options.seconds(budget, "--budget")
    with sole_writer(out, "--out"), spread(on):
        check_targets([out / name for name in FILES], "--out", [*records, *holdout, rig])
        belief = Catalogue.read(effects).given_to(read_deployed_rig(rig))
        train, held = read_series(records, holdout, belief)
        for part, read in (("train", train), ("holdout", held)):
            for record in read:
                console.notes().print(TEXT("close_loop.read", record=record.name, rows=len(record), role=PARTS[part]))
        same = _same_search([*records, *holdout, rig, *effects], f"{seed} {budget_s} {len(holdout)} {out.resolve()}")
        with _termination_interrupts(), keeping(same) as done:
            if done:
                console.note(TEXT("close_loop.goes_on", count=done))
            try:
                finding = find_and_write(belief, train, held, out, seed, budget_s)
            except KeyboardInterrupt:
                raise console.InterruptionError(TEXT("close_loop.interrupted")) from None
    if json_output:
        written = [str(out / name) for name in FILES if (out / name).exists()]
        console.print_json({**report_json(finding), "files": written})
    else:
        print_summary(finding, out)


def _same_search(files: Sequence[Path], asked: str) -> Path:
    """The file with what is done of the search in these `files`; those older than a month are removed."""
    folder = private_folder(cache_folder() / "searches")
    for old in folder.iterdir():
        if time.time() - old.stat().st_mtime > _KEPT_S:
            old.unlink(missing_ok=True)
    inputs = hashlib.sha256(f"{program_version()} {asked}".encode())
    for path in files:
        inputs.update(f"{path.name}\n".encode())
        with opened(path, "record") as file:
            for block in iter(partial(file.read, 1 << 20), b""):
                inputs.update(block)
    return folder / inputs.hexdigest()


@contextmanager
def _termination_interrupts() -> Iterator[None]:
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def read_series(
    records: Sequence[Path], holdout: Sequence[Path], rig: Rig, *, lenient: bool = False
) -> tuple[list[Record], list[Record]]:
    """Training and held-out records with different names; `lenient`: with times and values as they stand."""
    seen: set[str] = set()
    for path in (*records, *holdout):
        real = os.path.realpath(path)  # unlike `Path.resolve`, it takes a link that leads to itself
        if real in seen:
            raise ValueError(f"records must be different files, for training or held out; got {path} twice")
        seen.add(real)
    paths = (*records, *holdout)
    read = [noted_record(path, rig, lenient=lenient) for path in paths]
    names = [record.name for record in read]
    strange = next((name for name in rig.differing if name not in names), None)
    if strange is not None:
        raise ValueError(f"[[record]] file must be one of the records, {', '.join(names)}; got {strange!r}")
    for k, path in enumerate(paths):
        if names.count(names[k]) > 1:
            read[k] = replace(read[k], name=f"{path.resolve().parent.name}/{names[k]}")
    return read[: len(records)], read[len(records) :]


def noted_record(path: Path, rig: Rig, *, driven_only: bool = False, lenient: bool = False) -> Record:
    """A record of `rig`, as `read_rig_record` reads it; its notes are printed on standard error."""
    record = read_rig_record(path, rig, driven_only=driven_only, lenient=lenient)
    for said in record.said:
        console.note(f"{record.name}: {said}")
    return record


def find_and_write(rig: Rig, train: list[Record], held: list[Record], out: Path, seed: int, budget_s: float) -> Finding:
    """Close the loop and write its files to `out`; a next experiment from before does not stay."""
    with console.progress_bar("close-loop") as progress, console.output_to_notes():
        finding, model = close(rig, train, held, progress, seed=seed, told=_tell, budget_s=budget_s)
        files = result_files(finding, model)
    write_files({out / name: content for name, content in files.items()})
    for name in {NEXT_TOML, NEXT_CSV} - set(files):
        (out / name).unlink(missing_ok=True)
    return finding


def _tell(sizes: Mapping[str, Quantity]) -> None:
    if sizes:
        console.notes().print(sizes_table(sizes))


def sizes_table(sizes: Mapping[str, Quantity]) -> Table:
    """The smallest amplitude of each effect that the records would show."""
    table = console.text_table(TEXT("close_loop.smallest"), ("effect", "from"), ("effect",))
    for name, size in sizes.items():
        table.add_row(effect_words(name), str(size))
    return table


def result_files(finding: Finding, model: Model) -> dict[str, str]:
    files = {REPORT: report_html(finding), NUMBERS: console.json_text(report_json(finding)), MODEL: model.to_toml()}
    if finding.proposal is None:
        return files
    return files | {NEXT_TOML: next_toml(finding.proposal, finding.kind), NEXT_CSV: table_text(finding.proposal.motion)}


def print_summary(finding: Finding, out: Path) -> None:
    terminal, depends = console.summary(), finding.dependence
    terminal.print(f"{finding.verdict}: ", style="bold", end="")
    terminal.print(headline(finding))
    said = (
        finding.left_out,
        confidence_words(finding),
        *finding.reasons,
        *(dependence_words(depends) if depends else ()),
    )
    console.say(*(f"  {sentence}" for sentence in said if sentence))
    if depends and depends.term:
        console.say(f"  {TEXT('close_loop.propose', out=out)}")
    for alike in grouped(finding.findings):
        more = TEXT("close_loop.more", count=len(alike) - 1) if len(alike) > 1 else ""
        console.say(f"{alike[0].severity}: {alike[0].sentence} {more}".rstrip())
    console.say(*map(disagreement_words, finding.disagreeing))
    terminal.print(*map(error_table, finding.by_column), sep="\n")
    console.say(*finding.leading[1:])
    console.say(TEXT("close_loop.report", path=out / REPORT), TEXT("close_loop.model", path=out / MODEL))
    if finding.proposal is not None:
        console.say(TEXT("close_loop.next", sentence=finding.next_experiment or ""))


def error_table(finding: Finding) -> Table:
    _, unit = error_scale(finding)
    title = TEXT("close_loop.error", unit=f" in {unit}" if unit else "", measure=finding.measure)
    table = console.text_table(title, ("", *STAGES, "noise floor"))
    for part, name in PARTS.items():
        table.add_row(name, *error_cells(finding, part))
    return table


def next_toml(proposal: Proposal, kind: str) -> str:
    """The reference, with positions from its start, and what it is expected to separate or to show."""
    tables: dict[str, Any] = {
        "experiment": {"kind": kind, "column": proposal.column, "duration_s": round(float(proposal.times_s[-1]), 4)},
        "reference": {
            "kind": "waypoints",
            "times_s": [round(float(t), 4) for t in proposal.times_s[1:]],
            "positions_mm": [round(_MM * float(x - proposal.places_m[0]), 4) for x in proposal.places_m[1:]],
        },
    }
    if proposal.separations:
        tables["separates"] = {
            f"{one.effect}_from_{one.rival}": {
                "standard_deviations": round(one.standard_deviations, 2),
                "best_record_so_far": one.best_record,
                "standard_deviations_so_far": round(one.so_far, 2),
            }
            for one in proposal.separations
        }
    if proposal.shows:
        tables["shows"] = {"effects": list(proposal.shows)}
    return f"# {TEXT('close_loop.next_file', file=NEXT_CSV)}\n{toml_text(tables)}"
