"""`capsule demo`: the loop on printed measurements, on a pull whose next record it proposes, and on two rigs that are
driven over the bus, recorded, identified and driven again.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final

from hil.app.close_loop import NUMBERS, REPORT
from hil.app.console import json_text, print_json, say, summary, text_table
from hil.app.demo.loop import LEARNING, LOOPS, LearningStory, LoopStory
from hil.app.demo.page import demo_html
from hil.app.demo.story import BEFORE, NEXT_RECORD, PRINTED, TEXT, End, Learned, Story, title_of
from hil.app.demo.worker import results_of, story_progress
from hil.app.shared_options import Json, Seed, option
from hil.app.sil.learning_page import NUMBERS as LEARNED_NUMBERS
from hil.app.sil.learning_page import PAGE as LEARNED
from hil.app.write import check_folder, sole_writer, write_files
from hil.report.numbers import report_json
from hil.report.words import headline
from models.effects import effect_words
from models.identification.finding import STAGES

PAGE, PAGE_NUMBERS = "demo.html", "demo.json"
STORIES: Final[tuple[Story, ...]] = (*PRINTED, NEXT_RECORD, *LOOPS, LEARNING)


def demo(
    out: Annotated[Path, option("--out", "DIR", "Folder for the reports.")] = Path("out/demo"),
    json_output: Json = False,
    seed: Seed = 0,
) -> None:
    """Run every story, print the errors before and after, and write the reports: `out`/demo.html and demo.json, and a
    folder for each story with its own, all of them or none. Raises ValueError.
    """
    began = time.monotonic()
    with sole_writer(out, "--out"), TemporaryDirectory(dir=out, prefix=".demo-") as hidden:
        work = Path(hidden)
        longest_first = sorted(
            STORIES, key=lambda s: (not isinstance(s, LoopStory | LearningStory), s.name != LOOPS[-1].name)
        )
        with story_progress([story.name for story in STORIES]) as report:
            found = results_of(longest_first, work, seed, report)
        ends = [(story, found[story.name]) for story in STORIES]
        seconds = time.monotonic() - began
        document = {
            "stories": [_numbers(story, one, out / story.name) for story, one in ends],
            "report": str(out / PAGE),
            "seed": seed,
            "seconds": seconds,
        }
        write_files({work / PAGE: demo_html(ends, seconds), work / PAGE_NUMBERS: json_text(document)})
        for file in sorted(path for path in work.rglob("*") if path.is_file()):
            target = out / file.relative_to(work)
            check_folder(target.parent, "--out")
            file.replace(target)
    if json_output:
        print_json(document)
    else:
        _say(ends, out, seconds)


def _numbers(story: Story, one: End, folder: Path) -> dict[str, Any]:
    """A story as JSON: the numbers of its report and of the one before the proposed record; of a driven one the
    acceptance and the tracking of each model; of a run that learned its outcome.
    """
    page, numbers = (LEARNED, LEARNED_NUMBERS) if isinstance(one, Learned) else (REPORT, NUMBERS)
    document: dict[str, Any] = {"story": story.name, "title": title_of(story), "report": str(folder / page)}
    document |= {"numbers": str(folder / numbers), "hidden": ", ".join(one.hidden) or None}
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


def _say(ends: Sequence[tuple[Story, End]], out: Path, seconds: float) -> None:
    console = summary()
    heads = ("story", "error of", *STAGES, "noise floor", "verdict")
    table = text_table(TEXT("table"), heads, ("story", "error of", "verdict"))
    table.show_lines = True
    lines = []
    for story, one in ends:
        folder = out / story.name
        if isinstance(one, Learned):
            lines.append(TEXT("learned", story=story.name, sentence=one.sentence, page=folder / LEARNED))
            continue
        table.add_row(title_of(story), *one.errors(), f"{headline(one.finding)} {one.caution}".strip())
        if one.missions:
            gate = (TEXT("gate", stage=stage, sentence=verdict.sentence) for stage, verdict in one.gate.items())
            table.add_row(f"  {TEXT('again')}", TEXT("tracking"), *one.tracked(), "", "; ".join(gate))
        lines.append(TEXT("report", story=story.name, page=folder / REPORT))
        if one.before is not None:
            lines.append(f"  {TEXT('before', headline=headline(one.before), page=folder / BEFORE / REPORT)}")
        if one.hidden:
            lines.append(f"  {TEXT('hidden', effects=map(effect_words, one.hidden))}")
    console.print(table)
    say(*lines, TEXT("all", page=out / PAGE), TEXT("seconds", seconds=seconds))
