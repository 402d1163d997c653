"""The demo's run that learns: an effect begins on the way, the controller notices, finds it and goes on with the better
model.
"""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from pathlib import Path

from hil.app.console import json_text
from hil.app.demo.loop import SCENARIOS, SEEDS
from hil.app.demo.story import Learned, Progress
from hil.app.learn.identify import answer_at_once
from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.sil.command import judged
from hil.app.sil.loop import learning_of
from hil.app.sil.story import NUMBERS, came_to, story_files
from hil.app.sil.testbed import believed_on_bus
from hil.app.write import write_files
from models.files.toml import toml_text
from models.theta import Theta


@dataclass(frozen=True)
class LearningStory:
    """A scenario as `capsule sil --learn` runs it; the search runs in the story's own process."""

    name: str
    title: str
    scenario: Path

    def tell(self, folder: Path, seed: int, report: Progress) -> Learned:
        """The run, its page and its numbers."""
        raw = tomllib.loads(self.scenario.read_text(encoding="utf-8"))
        number = raw["scenario"].get("seed", 0) + SEEDS * seed
        tables = {**raw, "scenario": {**raw["scenario"], "seed": number}}
        scenario = parse_sil_scenario(tables)
        model, learning = believed_on_bus(scenario, Theta()), learning_of(scenario, Theta(), answer_at_once)
        found, trace = judged(scenario, model, None, number, "nominal", report, learning=learning)
        found["learned"] = [lesson.document() for lesson in trace.lessons]
        files = story_files(folder, scenario, found, trace)
        numbers = json.loads(files[folder / NUMBERS])
        write_files({folder / "sil.json": json_text(found), folder / "scenario.toml": toml_text(tables), **files})
        return Learned(came_to(trace.lessons), numbers, found, tuple(scenario.loop.truth.hidden))


LEARNING = LearningStory(
    "learning", "simulated magnetic rig that learns while it runs", SCENARIOS / "demo_learning.toml"
)
