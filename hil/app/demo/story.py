"""What a story of the demo is: it goes from its data to a finding, and what the printed measurements tell."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from controller.supervision.acceptance import Acceptance
from hil.app.close_loop import read_series, result_files
from hil.app.papers.analytical import best_miss, thirty_periods
from hil.app.write import write_files
from hil.report.words import error_cells, tested_part
from models.identification import Model, close
from models.identification.finding import STAGES, Finding
from models.rigs.reader import read_rig
from models.rigs.rig import Rig
from models.sets import measured_path
from models.words.quantities import DASH, change, quantity

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
RIG, BEFORE = "rig.toml", "before"


@dataclass(frozen=True)
class Mission:
    """The last run of a loop with one stage of the model: what `capsule sil` prints, and the true path."""

    numbers: Mapping[str, Any]
    time_s: Array
    position_m: Array
    reference_m: Array


@dataclass(frozen=True)
class StoryResult:
    """What came of a story. `gate` holds the verdict on each stage that asked to be let in, `missions` the runs of
    those that were, and `hidden` what the simulated plant kept to itself; all three are empty where nothing was
    driven. `caution` is what the error must not be taken for, `truth` the numbers of what was hidden, by effect.
    `before` is what was found without the record that it proposed.
    """

    finding: Finding
    gate: Mapping[str, Acceptance] = field(default_factory=dict)
    missions: Mapping[str, Mission] = field(default_factory=dict)
    hidden: tuple[str, ...] = ()
    caution: str = ""
    truth: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    before: Finding | None = None

    def errors(self) -> list[str]:
        """What the prediction was tested on, its error by stage and the noise floor, in words."""
        part = tested_part(self.finding)
        where = "prediction, held out" if part == "holdout" else "prediction, training"
        return [where, *error_cells(self.finding, part)]

    def tracked(self) -> list[str]:
        """The rms tracking error by stage, a dash where the gate let none in."""
        rms = {stage: quantity(mission.numbers["tracking_rmse_m"], "m") for stage, mission in self.missions.items()}
        return [rms.get(stage, DASH) for stage in STAGES]


@dataclass(frozen=True)
class Learned:
    """What came of a run that learned, in a sentence; `numbers` are those of its page, `found` its JSON object,
    `hidden` what the simulated plant kept to itself.
    """

    sentence: str
    numbers: Mapping[str, Any]
    found: Mapping[str, Any]
    hidden: tuple[str, ...]


End = StoryResult | Learned


class Story(Protocol):
    """One line of the demo: its `name`, which is its folder's, and what it is about."""

    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...

    def tell(self, folder: Path, seed: int, report: Progress) -> End:
        """Do it all, with every file in `folder`."""
        ...


@dataclass(frozen=True)
class PrintedStory:
    """A measurement that a paper prints, through close-loop. `measured` names its file in `models/sets`, `rig` is the
    rig file, `caution` tells of the finding what its error must not be taken for.
    """

    name: str
    title: str
    measured: str
    rig: str
    caution: Callable[[Finding], str] | None = None

    def tell(self, folder: Path, seed: int, report: Progress) -> StoryResult:
        """Records and rig file, then the loop."""
        record = folder / f"{self.measured}.csv"
        write_files({folder / RIG: self.rig, record: measured_path(self.measured).read_bytes()})
        rig = read_rig(folder / RIG)
        finding = found_in([record], [], rig, folder, seed, report)[0]
        return StoryResult(finding, caution=self.caution(finding) if self.caution else "")


def found_in(
    records: list[Path], holdout: list[Path], rig: Rig, folder: Path, seed: int, report: Progress
) -> tuple[Finding, Model]:
    """Close the loop on files and write its three to `folder`."""
    finding, model = close(rig, *read_series(records, holdout, rig), report, seed=seed)
    write_files({folder / name: content for name, content in result_files(finding, model).items()})
    return finding, model


def against_thirty(finding: Finding) -> str:
    """How far the model of the eight periods is off the means of the thirty that paper A states and no fit has seen."""
    stage = "augmented" if finding.effects else "calibrated"
    predicted = finding.traces[0].predicted[stage].mean(0)
    off = [
        f"{name} {change(1 + best_miss(value, means), 1.0)}"
        for (name, means), value in zip(thirty_periods().items(), predicted, strict=True)
    ]
    return (
        "As many numbers as means are fitted: on the eight periods that is an interpolation, whatever its error."
        f" Against the means of A's thirty periods, held out: {', '.join(off)} (their signs are not printed; the nearer"
        " one)."
    )


_PERIODS = "eight measured stick-slip periods, paper A"
_SPECTRUM = "measured moduli of three gut samples, paper V"
_PERIODS_RIG = '[rig]\nkind = "periods"\nvelocity_m_s = 0.5e-3\n'
PRINTED = (
    PrintedStory("periods", _PERIODS, "analytical_table2_periods", _PERIODS_RIG, against_thirty),
    PrintedStory("spectrum", _SPECTRUM, "viscoelastic_table2_dma", '[rig]\nkind = "dma"\n'),
)
