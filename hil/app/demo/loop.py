"""The demo's loops: drive over the bus, log, identify, accept a model, drive again with it; and a run that learns."""

import json
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from controller.choice.choose import Progress
from controller.supervision.acceptance import Acceptance, judge
from hil.app.console import json_text, part_of
from hil.app.demo.example import HOLDOUT, RIG, SCENARIOS, SEEDS, ExampleResult, Learned, Mission, found_in
from hil.app.learn.identify import answer_at_once
from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.sil.learning_page import NUMBERS, came_to, learning_files
from hil.app.sil.loop import learning_of
from hil.app.sil.sil import judged
from hil.app.sil.testbed import believed_on_bus
from hil.app.write import write_files
from hil.log.log import LockstepLog
from hil.log.recorder import Recorder, log_record
from hil.nodes.frame_map import frames
from hil.report.numbers import report_json
from models.files.toml import beside, toml_text
from models.identification import Model
from models.identification.finding import STAGES, Finding
from models.rigs.reader import read_rig
from models.rigs.rig import Rig
from models.theta import Theta
from plant import layout as at

MISSION: Final = "mission"
_DRIVEN, _FOUND = 0.12, 0.75  # shares of the work up to the end of the drives, and of the search
_MOST_ROWS: Final = 4000  # of a path that is drawn
Tables = dict[str, Any]


@dataclass(frozen=True)
class LoopExample:
    """A rig on the simulated bus. `scenario` is a file of `capsule sil` with all of [belief]. Its run is the mission,
    driven with the nominal model and with each model that is accepted, under one seed. `training` and `holdout`,
    each a table [reference] and a `duration_s`, are driven before, with the nominal model, under seeds of their own.
    """

    name: str
    scenario: Path
    training: Sequence[Tables]
    holdout: Tables

    def runs(self, seed: int) -> dict[str, Tables]:
        mission: Tables = tomllib.loads(self.scenario.read_text(encoding="utf-8"))
        first = mission["scenario"].get("seed", 0) + SEEDS * seed
        driven = {**{f"train_{k}": one for k, one in enumerate(self.training, start=1)}, HOLDOUT: self.holdout}
        runs = {MISSION: {**mission, "scenario": {**mission["scenario"], "seed": first}}}
        for number, (name, one) in enumerate(driven.items(), start=1):
            run = {"name": f"{self.name} {name}", "duration_s": one["duration_s"], "seed": first + number}
            runs[name] = {**mission, "scenario": run, "reference": one["reference"]}
        return runs

    def run(self, folder: Path, seed: int, report: Progress) -> ExampleResult:
        """The whole loop; `folder` gets each run's scenario and log, the rig file and what close-loop writes."""
        runs = self.runs(seed)
        belief = toml_text(runs[MISSION]["belief"])
        write_files(
            {folder / f"{name}.toml": toml_text(tables) for name, tables in runs.items()} | {folder / RIG: belief}
        )
        logs = {}
        for number, name in enumerate(name for name in runs if name != MISSION):
            report(f"driving {name}", _DRIVEN * number / len(runs))
            logs[name] = _drive(folder, name, runs[name], Theta(), "nominal", name)[1]
        rig, held = read_rig(folder / RIG), logs.pop(HOLDOUT)
        records, searching = [logs[name] for name in sorted(logs)], part_of(report, _DRIVEN, _FOUND)
        finding, model = found_in(records, [held], rig, folder, seed, searching)
        gate = dict(admitted(finding, model, rig))
        missions = {}
        accepted = ["nominal", *(stage for stage, verdict in gate.items() if verdict.passed)]
        for number, stage in enumerate(accepted):
            report(f"driving again, {stage} model", _FOUND + (1 - _FOUND) * number / len(accepted))
            missions[stage] = _drive(
                folder, MISSION, runs[MISSION], model.believed(stage), stage, f"{MISSION}_{stage}"
            )[0]
        report("done", 1.0)
        return ExampleResult(finding, gate, missions, truth=runs[MISSION].get("effects", {}))


def admitted(finding: Finding, model: Model, rig: Rig) -> Iterator[tuple[str, Acceptance]]:
    """The acceptance of each stage against the last accepted one; the nominal model is in use first."""
    current = STAGES[0]
    for stage in STAGES[1:]:
        verdict = judge(report_json(finding), model, rig, stage=stage, current=current)
        current = stage if verdict.passed else current
        yield stage, verdict


def _drive(folder: Path, name: str, tables: Tables, values: Theta, stage: str, log_name: str) -> tuple[Mission, Path]:
    scenario = parse_sil_scenario(tables)
    loop, log_path = scenario.loop, folder / f"{log_name}.blf"
    text = (folder / f"{name}.toml").read_text(encoding="utf-8")
    record = log_record({"scenario": text}, loop.control.controller, values, loop.limits, frames(), seed=loop.seed)
    with LockstepLog(log_path, record) as log:
        model = believed_on_bus(scenario, values)
        numbers, trace = judged(scenario, model, None, loop.seed, stage, recorder=Recorder(log))
    numbers |= {"log": log_path.name, "stopped_because": trace.stopped_because}
    rows = trace.rows[:: max(1, len(trace.rows) // _MOST_ROWS)]
    t = rows[:, at.O_T]
    return Mission(numbers, t, rows[:, at.O_X], loop.reference.position(t)), log_path


LOOPS: Final = tuple(
    LoopExample(name, SCENARIOS / table["scenario"], table["training"], table["holdout"])
    for name, table in beside(__file__, "loops.toml").items()
)


@dataclass(frozen=True)
class LearningExample:
    """A scenario as `capsule sil --learn` runs it; the search runs in the example's own process."""

    name: str
    scenario: Path

    def run(self, folder: Path, seed: int, report: Progress) -> Learned:
        raw = tomllib.loads(self.scenario.read_text(encoding="utf-8"))
        number = raw["scenario"].get("seed", 0) + SEEDS * seed
        tables = {**raw, "scenario": {**raw["scenario"], "seed": number}}
        scenario = parse_sil_scenario(tables)
        model, learning = believed_on_bus(scenario, Theta()), learning_of(scenario, Theta(), answer_at_once)
        found, trace = judged(scenario, model, None, number, "nominal", report, learning=learning)
        found["learned"] = [lesson.document() for lesson in trace.lessons]
        files = learning_files(folder, scenario, found, trace)
        numbers = json.loads(files[folder / NUMBERS])
        write_files({folder / "sil.json": json_text(found), folder / "scenario.toml": toml_text(tables), **files})
        learnt = trace.offers[-1].values.effects if trace.offers else {}
        return Learned(came_to(trace.lessons), numbers, found, raw["effects"], learnt)


LEARNING = LearningExample("learning", SCENARIOS / "demo_learning.toml")
