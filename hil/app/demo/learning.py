"""The demo's run that learns: an effect begins on the way, the controller notices, finds it and goes on with the better
model.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from controller.supervision.model_switch import ModelSwitch
from hil.app.console import json_text
from hil.app.demo.loop import SCENARIOS
from hil.app.demo.story import Learned, Progress
from hil.app.learn.identify import at_once
from hil.app.learn.learner import Learner
from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.sil.command import judged
from hil.app.sil.story import came_to, story_files, story_numbers
from hil.app.sil.testbed import believed_on_bus
from hil.app.write import write_files
from models.files.toml import toml_text

_SEEDS = 1000


@dataclass(frozen=True)
class LearningStory:
    """A scenario as `capsule sil --learn` runs it; the search runs in the story's own process."""

    name: str
    title: str
    scenario: Path

    def tell(self, folder: Path, seed: int, report: Progress) -> Learned:
        """The run, its page and its numbers."""
        raw = tomllib.loads(self.scenario.read_text(encoding="utf-8"))
        number = raw["scenario"].get("seed", 0) + _SEEDS * seed
        scenario = parse_sil_scenario({**raw, "scenario": {**raw["scenario"], "seed": number}})
        believed = partial(believed_on_bus, scenario)

        def learner(switch: ModelSwitch) -> Learner:
            return Learner(switch, scenario.loop.belief, {}, believed, at_once, scenario.pace)

        found, trace = judged(scenario, believed({}), None, number, "nominal", report, learning=learner)
        found["learned"] = [lesson.document() for lesson in trace.lessons]
        files = story_files(folder, scenario, found, trace)
        write_files({folder / "sil.json": json_text(found), folder / "scenario.toml": toml_text(raw), **files})
        return Learned(
            came_to(trace.lessons),
            story_numbers(scenario, found, trace),
            found,
            tuple(scenario.loop.truth.hidden),
        )


LEARNING = LearningStory(
    "learning", "simulated magnetic rig that learns while it runs", SCENARIOS / "demo_learning.toml"
)
