"""The demo's next experiment: records that cannot tell two effects apart, the record that close-loop proposes for it,
and what the effect is then.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hil.app.demo.loop import HOLDOUT, SCENARIOS, SEEDS
from hil.app.demo.story import BEFORE, RIG, Progress, StoryResult, found_in
from hil.app.simulate import write_simulated
from hil.app.write import write_files
from models.files.toml import toml_text
from models.identification.finding import NEXT_CSV, Proposal
from models.rigs.reader import read_rig
from plant.experiments.examples import BELIEVED

POOR: Final = ("pass_1", "pass_2")
NEXT: Final = "next"
_SEARCHED: Final = 0.45  # share of the work up to the end of the first search
Tables = Mapping[str, Any]


@dataclass(frozen=True)
class NextRecordStory:
    """A simulated pull. `scenario` is a file as `capsule simulate` reads it: its run, twice over, is all that is
    recorded at first. `further` is the table [profile] of the held-out record, which lasts `further_s`.
    """

    name: str
    title: str
    scenario: Path
    further: Tables
    further_s: float

    def tell(self, folder: Path, seed: int, report: Progress) -> StoryResult:
        """Both loops. `folder` gets scenario and record of every run, the rig file and what the second writes, its
        folder `before` what the first does.
        """
        raw = tomllib.loads(self.scenario.read_text(encoding="utf-8"))
        first = raw["scenario"].get("seed", 0) + SEEDS * seed
        write_files({folder / RIG: toml_text(BELIEVED["pull"].tables())})
        rig, before = read_rig(folder / RIG), folder / BEFORE
        before.mkdir()

        def record(name: str, number: int, **changed: Tables) -> Path:
            run = {**raw["scenario"], "name": f"{self.name} {name}", "seed": first + number}
            tables = {**raw, **changed, "scenario": run | dict(changed.get("scenario", {}))}
            write_files({folder / f"{name}.toml": toml_text(tables)})
            write_simulated(folder / f"{name}.toml", folder / f"{name}.csv")
            return folder / f"{name}.csv"

        def part(begin: float, end: float) -> Progress:
            return lambda stage, share: report(stage, begin + (end - begin) * share)

        poor = [record(name, number) for number, name in enumerate(POOR)]
        unsure, _ = found_in(poor, [], rig, before, seed, part(0.0, _SEARCHED))
        records = poor
        if unsure.proposal is not None:
            report("recording what was proposed", _SEARCHED)
            records = [*poor, record(NEXT, len(POOR), **_as_proposed(unsure.proposal))]
        length = {"duration_s": self.further_s}
        held = record(HOLDOUT, len(POOR) + 1, profile=self.further, scenario=length)
        finding, _ = found_in(records, [held], rig, folder, seed, part(_SEARCHED, 1.0))
        truth = raw["effects"]
        return StoryResult(finding, hidden=tuple(truth), truth=truth, before=unsure)


def _as_proposed(proposal: Proposal) -> dict[str, Tables]:
    """The scenario's tables that drive the rig as the next experiment's CSV says."""
    profile = {"kind": "record", "path": f"{BEFORE}/{NEXT_CSV}", "column": proposal.column}
    return {"profile": profile, "scenario": {"duration_s": round(float(proposal.times_s[-1]), 3)}}


NEXT_RECORD = NextRecordStory(
    "next_record",
    "simulated pull, one pass and the record proposed after it",
    SCENARIOS / "demo_next_record.toml",
    {
        "kind": "runs",
        "speeds_m_s": [0.0, 0.003, -0.002, 0.001, -0.004],
        "durations_s": [0.5, 5.0, 6.0, 6.0, 2.0],
    },
    20.0,
)
