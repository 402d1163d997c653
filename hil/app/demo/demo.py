"""`capsule demo`: the loop on printed measurements, on a pull whose next record it proposes, and on two rigs that are
driven over the bus, recorded, learnt from and driven again.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final

from hil.app.console import json_text, print_json, summary, text_table
from hil.app.demo.loop import LEARNING, LOOPS, LearningStory, LoopStory
from hil.app.demo.next_record import NEXT_RECORD
from hil.app.demo.page import demo_html
from hil.app.demo.story import BEFORE, PRINTED, Learned, Story, Told
from hil.app.demo.worker import story_bars, told
from hil.app.identify.close_loop import NUMBERS, REPORT
from hil.app.shared_options import Json, Seed, option
from hil.app.sil.story import NUMBERS as LEARNED_NUMBERS
from hil.app.sil.story import PAGE as LEARNED
from hil.app.write import check_folder, sole_writer, write_files
from hil.report.numbers import report_json
from hil.report.words import effect_words, headline, listed
from models.identification.finding import STAGES

PAGE, PAGE_NUMBERS = "demo.html", "demo.json"
STORIES: Final[tuple[Story, ...]] = (*PRINTED, NEXT_RECORD, *LOOPS, LEARNING)


def demo(
    out: Annotated[Path, option("--out", "DIR", "Folder for the reports.")] = Path("out/demo"),
    json_output: Json = False,
    seed: Seed = 0,
) -> None:
    """Tell every story, print the errors before and after, and leave the reports: `out`/demo.html and demo.json, and a
    folder for each story with its own. All of it takes its place at the end or not at all. Raises ValueError of one
    sentence.
    """
    began = time.monotonic()
    with sole_writer(out, "--out"), TemporaryDirectory(dir=out, prefix=".demo-") as hidden:
        work = Path(hidden)
        longest_first = sorted(
            STORIES, key=lambda s: (not isinstance(s, LoopStory | LearningStory), s.name != LOOPS[-1].name)
        )
        with story_bars([story.name for story in STORIES]) as report:
            found = told(longest_first, work, seed, report)
        both = [(story, found[story.name]) for story in STORIES]
        lines = [(story, one) for story, one in both if isinstance(one, Told)]
        learned = [(story, one) for story, one in both if isinstance(one, Learned)]
        seconds = time.monotonic() - began
        document = {
            "stories": [
                *(_numbers(story, one, out / story.name) for story, one in lines),
                *(_learned_numbers(story, one, out / story.name) for story, one in learned),
            ],
            "report": str(out / PAGE),
            "seed": seed,
            "seconds": seconds,
        }
        write_files({work / PAGE: demo_html(lines, seconds, learned), work / PAGE_NUMBERS: json_text(document)})
        _put(work, out)
    if json_output:
        print_json(document)
    else:
        _say(lines, learned, out, seconds)


def _put(work: Path, out: Path) -> None:
    """Move all files into place."""
    for file in sorted(path for path in work.rglob("*") if path.is_file()):
        target = out / file.relative_to(work)
        check_folder(target.parent, "--out")
        file.replace(target)


def _numbers(story: Story, one: Told, folder: Path) -> dict[str, Any]:
    """A story as JSON: the numbers of its report, those of the one before the record that it proposed, and of a driven
    one what the gate said and how well each model tracked.
    """
    document: dict[str, Any] = {
        "story": story.name,
        "title": story.title,
        "report": str(folder / REPORT),
        "numbers": str(folder / NUMBERS),
        "hidden": ", ".join(one.hidden) or None,
        "caution": one.caution or None,
        **report_json(one.finding),
    }
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


def _learned_numbers(story: Story, one: Learned, folder: Path) -> dict[str, Any]:
    """A run that learned as JSON."""
    return {
        "story": story.name,
        "title": story.title,
        "report": str(folder / LEARNED),
        "numbers": str(folder / LEARNED_NUMBERS),
        "hidden": ", ".join(one.hidden) or None,
        "came_to": one.sentence,
        "hard_violations": one.found["hard_violations"],
        **{key: one.numbers[key] for key in ("instants", "parts", "learned")},
    }


def _say(
    lines: Sequence[tuple[Story, Told]], learned: Sequence[tuple[Story, Learned]], out: Path, seconds: float
) -> None:
    console = summary()
    heads = ("story", "error of", *STAGES, "noise floor", "verdict")
    table = text_table("Before and after", heads, ("story", "error of", "verdict"))
    table.show_lines = True
    for story, one in lines:
        table.add_row(story.title, *one.errors(), f"{headline(one.finding)} {one.caution}".strip())
        if one.missions:
            table.add_row("  the same run driven again", "tracking", *one.tracked(), "", _gate_words(one))
    console.print(table)
    for story, one in lines:
        console.print(f"{story.name}: {out / story.name / REPORT}", soft_wrap=True)
        if one.before is not None:
            said = f"  before the proposed record: {headline(one.before)} {out / story.name / BEFORE / REPORT}"
            console.print(said, soft_wrap=True)
        if one.hidden:
            words = listed(effect_words(name) for name in one.hidden)
            console.print(f"  what the simulated rig kept to itself: {words}")
    for story, learnt in learned:
        console.print(f"{story.name}: {learnt.sentence}: {out / story.name / LEARNED}", soft_wrap=True)
    console.print(f"all: {out / PAGE}", soft_wrap=True)
    console.print(f"{seconds:.0f} s")


def _gate_words(one: Told) -> str:
    return "; ".join(f"gate, {stage}: {verdict.sentence}" for stage, verdict in one.gate.items())
