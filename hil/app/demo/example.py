"""The examples of the demo and their results; those on records: printed measurements, a pull and its next record."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

from controller.choice.choose import Progress
from controller.signals import Array
from controller.supervision.acceptance import Acceptance
from hil.app.close_loop import read_series, result_files
from hil.app.console import part_of
from hil.app.papers.analytical import best_miss, thirty_periods
from hil.app.simulate import write_simulated
from hil.app.write import write_files
from hil.report.words import error_cells, tested_part
from models.files.toml import toml_text
from models.identification import Model, close
from models.identification.finding import NEXT_CSV, STAGES, Finding
from models.rigs.reader import read_rig
from models.rigs.rig import Rig
from models.sets import measured_path
from models.words.quantities import DASH, change, quantity
from models.words.sentences import Sentences
from plant.experiments.examples import BELIEVED

TEXT: Final = Sentences(__file__)
SCENARIOS: Final = Path(__file__).parents[2] / "scenarios"
RIG, BEFORE, HOLDOUT = "rig.toml", "before", "holdout"
SEEDS = 1000  # by which seeds of two examples are apart
_SEARCHED: Final = 0.45  # share of the work up to the end of the first search
Tables = Mapping[str, Any]


@dataclass(frozen=True)
class Mission:
    """The last run of a loop with one stage of the model: what `capsule sil` prints, and the true path."""

    numbers: Mapping[str, Any]
    time_s: Array
    position_m: Array
    reference_m: Array


@dataclass(frozen=True)
class ExampleResult:
    """What came of an example. `gate` holds the acceptance of each stage that was tested, `missions` the runs of those
    that passed, `truth` the numbers of what the simulated plant hid, by effect; all three are empty where nothing was
    driven. `caution` says what the error must not be taken for. `before` is what was found without the proposed record.
    """

    finding: Finding
    gate: Mapping[str, Acceptance] = field(default_factory=dict)
    missions: Mapping[str, Mission] = field(default_factory=dict)
    caution: str = ""
    truth: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    before: Finding | None = None

    def errors(self) -> list[str]:
        """What the prediction was tested on, its error by stage and the noise floor, in words."""
        part = tested_part(self.finding)
        return [TEXT(f"error_of.{part}"), *error_cells(self.finding, part)]

    def tracked(self) -> list[str]:
        """The rms tracking error by stage, a dash where the stage did not pass."""
        rms = {stage: quantity(mission.numbers["tracking_rmse_m"], "m") for stage, mission in self.missions.items()}
        return [rms.get(stage, DASH) for stage in STAGES]


@dataclass(frozen=True)
class Learned:
    """What came of a run that learned, in a sentence; `numbers` are those of its page, `found` its JSON object,
    `truth` the numbers of what the simulated plant hid, by effect, `learnt` those of the last model offered.
    """

    sentence: str
    numbers: Mapping[str, Any]
    found: Mapping[str, Any]
    truth: Mapping[str, Mapping[str, Any]]
    learnt: Mapping[str, Mapping[str, float]]


End = ExampleResult | Learned


class Example(Protocol):
    """One line of the demo: its `name`, which is its folder's."""

    @property
    def name(self) -> str: ...

    def run(self, folder: Path, seed: int, report: Progress) -> End:
        """Do it all, with every file in `folder`."""
        ...


def title_of(example: Example) -> str:
    return TEXT(f"title.{example.name}") if f"title.{example.name}" in TEXT else example.name


def found_in(
    records: list[Path], holdout: list[Path], rig: Rig, folder: Path, seed: int, report: Progress
) -> tuple[Finding, Model]:
    finding, model = close(rig, *read_series(records, holdout, rig), report, seed=seed)
    write_files({folder / name: content for name, content in result_files(finding, model).items()})
    return finding, model


@dataclass(frozen=True)
class PrintedExample:
    """A measurement that a paper prints, through close-loop: its file in `models/sets`, and the rig file."""

    name: str
    measured: str
    rig: str
    caution: Callable[[Finding], str] | None = None

    def run(self, folder: Path, seed: int, report: Progress) -> ExampleResult:
        record = folder / f"{self.measured}.csv"
        write_files({folder / RIG: self.rig, record: measured_path(self.measured).read_bytes()})
        finding = found_in([record], [], read_rig(folder / RIG), folder, seed, report)[0]
        return ExampleResult(finding, caution=self.caution(finding) if self.caution else "")


def against_thirty(finding: Finding) -> str:
    """The errors of the model of the eight periods on the means of the thirty that paper A states."""
    stage = "augmented" if finding.effects else "calibrated"
    predicted = finding.traces[0].predicted[stage].mean(0)
    errors = [
        TEXT("error", name=name, change=change(1 + best_miss(value, means), 1.0))
        for (name, means), value in zip(thirty_periods().items(), predicted, strict=True)
    ]
    return TEXT("interpolation", errors=errors)


@dataclass(frozen=True)
class NextRecordExample:
    """A simulated pull. `scenario` is a file of `capsule simulate`; its run, done twice, makes the first records.
    `further` is the table [profile] of the held-out record, which lasts `further_s`.
    """

    name: str
    scenario: Path
    further: Tables
    further_s: float

    def run(self, folder: Path, seed: int, report: Progress) -> ExampleResult:
        """Both loops; `folder` gets all files of the second, its folder `before` those of the first."""
        raw = tomllib.loads(self.scenario.read_text(encoding="utf-8"))
        first = raw["scenario"].get("seed", 0) + SEEDS * seed
        write_files({folder / RIG: toml_text(BELIEVED["pull"].tables())})
        rig, before = read_rig(folder / RIG), folder / BEFORE
        before.mkdir()

        def record(name: str, number: int, profile: Tables = raw["profile"], **changed: Any) -> Path:
            run = {**raw["scenario"], "name": f"{self.name} {name}", "seed": first + number, **changed}
            write_files({folder / f"{name}.toml": toml_text({**raw, "profile": profile, "scenario": run})})
            write_simulated(folder / f"{name}.toml", folder / f"{name}.csv")
            return folder / f"{name}.csv"

        records = [record("pass_1", 0), record("pass_2", 1)]
        unsure, _ = found_in(records, [], rig, before, seed, part_of(report, 0.0, _SEARCHED))
        if unsure.proposal is not None:
            report("recording what was proposed", _SEARCHED)
            profile = {"kind": "record", "path": f"{BEFORE}/{NEXT_CSV}", "column": unsure.proposal.column}
            length_s = round(float(unsure.proposal.times_s[-1]), 3)
            records.append(record("next", 2, profile, duration_s=length_s))
        held = record(HOLDOUT, 3, self.further, duration_s=self.further_s)
        finding, _ = found_in(records, [held], rig, folder, seed, part_of(report, _SEARCHED, 1.0))
        return ExampleResult(finding, truth=raw["effects"], before=unsure)


_PERIODS_RIG = '[rig]\nkind = "periods"\nvelocity_m_s = 0.5e-3\n'
PRINTED: Final = (
    PrintedExample("periods", "analytical_table2_periods", _PERIODS_RIG, against_thirty),
    PrintedExample("spectrum", "viscoelastic_table2_dma", '[rig]\nkind = "dma"\n'),
)
NEXT_RECORD: Final = NextRecordExample(
    "next_record",
    SCENARIOS / "demo_next_record.toml",
    {"kind": "runs", "speeds_m_s": [0.0, 0.003, -0.002, 0.001, -0.004], "durations_s": [0.5, 5.0, 6.0, 6.0, 2.0]},
    20.0,
)
