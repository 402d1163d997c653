"""`capsule demo`: the loop on printed measurements, on a pull whose next record it proposes, and on two rigs that are
driven over the bus, recorded, identified and driven again.
"""

import contextlib
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final

from rich.table import Table

from hil.app.close_loop import NUMBERS, REPORT
from hil.app.console import answer, json_text, notes, output_to_notes, progress_bar, stage_lines, text_table
from hil.app.demo.example import BEFORE, NEXT_RECORD, PRINTED, TEXT, End, Example, Learned, title_of
from hil.app.demo.loop import LEARNING, LOOPS, LearningExample, LoopExample
from hil.app.demo.page import demo_html
from hil.app.shared_options import Json, Seed, option
from hil.app.sil.learning_page import NUMBERS as LEARNED_NUMBERS
from hil.app.sil.learning_page import PAGE as LEARNED
from hil.app.write import check_folder, sole_writer, write_files
from hil.report.numbers import report_json
from hil.report.words import verdict_words
from models.effects import effect_words
from models.identification.finding import STAGES

PAGE, PAGE_NUMBERS = "demo.html", "demo.json"
EXAMPLES: Final[tuple[Example, ...]] = (*PRINTED, NEXT_RECORD, *LOOPS, LEARNING)


def demo(
    out: Annotated[Path, option("--out", "DIR")] = Path("out/demo"),
    json_output: Json = False,
    seed: Seed = 0,
) -> None:
    """Run every example, print the errors before and after, and write the reports: `out`/demo.html and demo.json, and a
    folder for each example with its own, all of them or none. Raises ValueError.
    """
    began = time.monotonic()
    with sole_writer(out, "--out"), TemporaryDirectory(dir=out, prefix=".demo-") as hidden:
        work = Path(hidden)
        longest_first = sorted(
            EXAMPLES, key=lambda s: (not isinstance(s, LoopExample | LearningExample), s.name != LOOPS[-1].name)
        )
        with example_progress([example.name for example in EXAMPLES]) as report:
            found = results_of(longest_first, work, seed, report)
        ends = [(example, found[example.name]) for example in EXAMPLES]
        seconds = time.monotonic() - began
        document = {
            "stories": [_numbers(example, one, out / example.name) for example, one in ends],
            "report": str(out / PAGE),
            "seed": seed,
            "seconds": seconds,
        }
        write_files({work / PAGE: demo_html(ends, seconds), work / PAGE_NUMBERS: json_text(document)})
        for file in sorted(path for path in work.rglob("*") if path.is_file()):
            target = out / file.relative_to(work)
            check_folder(target.parent, "--out")
            file.replace(target)
    answer(json_output, document, *_lines(ends, out, seconds))


def _numbers(example: Example, one: End, folder: Path) -> dict[str, Any]:
    """An example as JSON: the numbers of its report and of the one before the proposed record; of a driven one the
    acceptance and the tracking of each model; of a run that learned its outcome.
    """
    page, numbers = (LEARNED, LEARNED_NUMBERS) if isinstance(one, Learned) else (REPORT, NUMBERS)
    document: dict[str, Any] = {"story": example.name, "title": title_of(example), "report": str(folder / page)}
    document |= {"numbers": str(folder / numbers), "hidden": ", ".join(one.truth) or None}
    if isinstance(one, Learned):
        document |= {"came_to": one.sentence, "hard_violations": one.found["hard_violations"]}
        return document | {key: one.numbers[key] for key in ("instants", "parts", "learned")}
    document |= {"caution": one.caution or None, **report_json(one.finding)}
    if one.before is not None:
        document["before"] = {"report": str(folder / BEFORE / REPORT), **report_json(one.before)}
    if one.gate:
        document["gate"] = {
            stage: {"passed": verdict.passed, "reasons": list(verdict.reasons)} for stage, verdict in one.gate.items()
        }
        document["tracking"] = {
            stage: {**mission.numbers, "log": str(folder / mission.numbers["log"])}
            for stage, mission in one.missions.items()
        }
    return document


def _lines(ends: Sequence[tuple[Example, End]], out: Path, seconds: float) -> list[str | Table]:
    heads = ("example", "error of", *STAGES, "noise floor", "verdict")
    table = text_table(TEXT("table"), heads, ("example", "error of", "verdict"))
    table.show_lines = True
    lines: list[str | Table] = [table]
    for example, one in ends:
        folder = out / example.name
        if isinstance(one, Learned):
            lines.append(TEXT("learned", example=example.name, sentence=one.sentence, page=folder / LEARNED))
            continue
        table.add_row(title_of(example), *one.errors(), verdict_words(one.finding))
        if one.missions:
            gate = (TEXT("gate", stage=stage, sentence=verdict.sentence) for stage, verdict in one.gate.items())
            table.add_row(f"  {TEXT('again')}", TEXT("tracking"), *one.tracked(), "", "; ".join(gate))
        lines.append(TEXT("report", example=example.name, page=folder / REPORT))
        if one.caution:
            lines.append(f"  {one.caution}")
        if one.before is not None:
            lines.append(f"  {TEXT('before', verdict=verdict_words(one.before), page=folder / BEFORE / REPORT)}")
        if one.truth:
            lines.append(f"  {TEXT('hidden', effects=map(effect_words, one.truth))}")
    return [*lines, TEXT("all", page=out / PAGE), TEXT("seconds", seconds=seconds)]


WORKERS: Final = 2  # examples at a time
Reporter = Callable[[str, str, float], None]


def results_of(examples: Sequence[Example], folder: Path, seed: int, report: Reporter) -> dict[str, End]:
    """What came of each example by name. Each has a process and `folder`/name to itself; the first ones begin first.

    Raises an example's ValueError or OSError, RuntimeError where its process died; no process goes on after that or an
    interruption.
    """
    waiting, working, found = list(examples), dict[Connection, tuple[str, BaseProcess]](), dict[str, End]()
    try:
        while waiting or working:
            while waiting and len(working) < WORKERS:
                example = waiting.pop(0)
                process, words = _begin(example, folder / example.name, seed)
                working[words] = example.name, process
            ready = wait(list(working))
            for words in [words for words in working if words in ready]:
                name, process = working[words]
                try:
                    word = words.recv()
                except EOFError:
                    process.join()
                    raise RuntimeError(TEXT("dead", example=name, status=process.exitcode)) from None
                if isinstance(word, Exception):
                    raise word
                if isinstance(word, tuple):
                    report(name, *word)
                else:
                    found[name] = word
                    process.join()
                    del working[words]
    finally:
        for _, process in working.values():
            process.terminate()
            process.join()
    return found


def _begin(example: Example, folder: Path, seed: int) -> tuple[BaseProcess, Connection]:
    """A process that leaves Ctrl-C to this one, which ends it, and the end of its pipe."""
    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_tell, args=(example, folder, seed, theirs), daemon=True)
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process.start()
    finally:
        signal.signal(signal.SIGINT, handler)
    theirs.close()
    return process, ours


def _tell(example: Example, folder: Path, seed: int, words: Connection) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with output_to_notes():
            words.send(example.run(folder, seed, lambda stage, share: words.send((stage, share))))
    except ValueError as error:
        words.send(ValueError(str(error)))
    except BrokenPipeError:
        sys.exit(1)
    except OSError as error:
        words.send(error)


@contextlib.contextmanager
def example_progress(names: Sequence[str]) -> Iterator[Reporter]:
    """Progress on standard error: one bar on a terminal, else lines. Yields `report(name, stage, share)`."""
    console, shares = notes(), dict.fromkeys(names, 0.0)
    lines = cache(lambda name: stage_lines(console, name))
    with progress_bar("demo") if console.is_terminal else contextlib.nullcontext() as bar:

        def report(name: str, stage: str, share: float) -> None:
            shares[name] = share
            if bar is None:
                lines(name)(stage, share)
            else:
                bar(f"{name}, {stage}", sum(shares.values()) / len(shares))

        yield report
