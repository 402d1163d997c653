"""`capsule demo`: the loop on printed measurements, on a pull whose next record it proposes, and on two rigs that are
driven over the bus, recorded, learnt from and driven again.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final

from hil.app.close_loop import NUMBERS, REPORT
from hil.app.console import json_text, print_json, say, summary, text_table
from hil.app.demo.loop import LEARNING, LOOPS, LearningStory, LoopStory
from hil.app.demo.next_record import NEXT_RECORD
from hil.app.demo.page import demo_html
from hil.app.demo.story import BEFORE, PRINTED, End, Learned, Story
from hil.app.demo.worker import story_bars, told
from hil.app.shared_options import Json, Seed, option
from hil.app.sil.story import NUMBERS as LEARNED_NUMBERS
from hil.app.sil.story import PAGE as LEARNED
from hil.app.write import check_folder, sole_writer, write_files
from hil.report.numbers import report_json
from hil.report.words import headline
from models.effects import effect_words
from models.identification.finding import STAGES
from models.words.sentences import listed

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
    """A story as JSON: the numbers of its report, those of the one before the record that it proposed, and of a driven
    one what the gate said and how well each model tracked; of a run that learned what it came to.
    """
    page, numbers = (LEARNED, LEARNED_NUMBERS) if isinstance(one, Learned) else (REPORT, NUMBERS)
    document: dict[str, Any] = {"story": story.name, "title": story.title, "report": str(folder / page)}
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
    table = text_table("Before and after", heads, ("story", "error of", "verdict"))
    table.show_lines = True
    lines = []
    for story, one in ends:
        folder = out / story.name
        if isinstance(one, Learned):
            lines.append(f"{story.name}: {one.sentence}: {folder / LEARNED}")
            continue
        table.add_row(story.title, *one.errors(), f"{headline(one.finding)} {one.caution}".strip())
        if one.missions:
            gate = "; ".join(f"gate, {stage}: {verdict.sentence}" for stage, verdict in one.gate.items())
            table.add_row("  the same run driven again", "tracking", *one.tracked(), "", gate)
        lines.append(f"{story.name}: {folder / REPORT}")
        if one.before is not None:
            lines.append(f"  before the proposed record: {headline(one.before)} {folder / BEFORE / REPORT}")
        if one.hidden:
            lines.append(f"  hidden in the simulated rig: {listed(map(effect_words, one.hidden))}")
    console.print(table)
    say(*lines, f"all: {out / PAGE}", f"{seconds:.0f} s")
