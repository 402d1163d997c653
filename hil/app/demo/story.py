"""What a story of the demo is: it goes from its data to a finding, and what the printed measurements tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from controller.supervision.acceptance import Verdict
from hil.app.identify.close_loop import read_series, result_files
from hil.app.write import write_files
from models.files.rig import Rig, read_rig
from models.identification import Model, close
from models.identification.finding import Finding
from models.sets import measured_path

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
RIG = "rig.toml"


@dataclass(frozen=True)
class Mission:
    """The last run of a loop under one stage of the model: its numbers as `capsule sil` prints them, and the true
    path.
    """

    numbers: Mapping[str, Any]
    time_s: Array
    position_m: Array
    reference_m: Array


@dataclass(frozen=True)
class Told:
    """What came of a story. `gate` holds the verdict on each stage that asked to be let in, `missions` the runs of
    those that were, and `hidden` what the simulated plant kept to itself; all three are empty where nothing was
    driven. `truth` are the numbers of what was hidden, by effect.
    """

    finding: Finding
    gate: Mapping[str, Verdict] = field(default_factory=dict)
    missions: Mapping[str, Mission] = field(default_factory=dict)
    hidden: tuple[str, ...] = ()
    truth: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


class Story(Protocol):
    """One line of the demo."""

    @property
    def name(self) -> str:
        """Its folder."""
        ...

    @property
    def title(self) -> str:
        """What it is about, in words."""
        ...

    def tell(self, folder: Path, seed: int, report: Progress) -> Told:
        """Do it all, with every file in `folder`."""
        ...


@dataclass(frozen=True)
class PrintedStory:
    """A measurement that a paper prints, through close-loop. `measured` names its file in `models/sets`, `rig` is the
    rig file.
    """

    name: str
    title: str
    measured: str
    rig: str

    def tell(self, folder: Path, seed: int, report: Progress) -> Told:
        """Records and rig file, then the loop."""
        record = folder / f"{self.measured}.csv"
        write_files({folder / RIG: self.rig, record: measured_path(self.measured).read_bytes()})
        rig = read_rig(folder / RIG)
        return Told(found_in([record], [], rig, folder, seed, report)[0])


def found_in(
    records: list[Path], holdout: list[Path], rig: Rig, folder: Path, seed: int, report: Progress
) -> tuple[Finding, Model]:
    """Close the loop on files and write its three to `folder`."""
    finding, model = close(rig, *read_series(records, holdout, rig), report, seed=seed)
    write_files({folder / name: content for name, content in result_files(finding, model).items()})
    return finding, model


PRINTED = (
    PrintedStory(
        "periods",
        "eight measured stick-slip periods, paper A",
        "analytical_table2_periods",
        '[rig]\nkind = "periods"\nvelocity_m_s = 0.5e-3\n',
    ),
    PrintedStory(
        "spectrum",
        "measured moduli of three gut samples, paper V",
        "viscoelastic_table2_dma",
        '[rig]\nkind = "dma"\n',
    ),
)
