"""`capsule demo`: the loop on printed measurements and on a simulated rig with an effect it keeps to itself."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from hil.app.close_loop import REPORT, find_and_write, read_series
from hil.app.console import notes, print_json, summary
from hil.app.report import headline, report_json
from hil.app.report.words import STAGE_WORDS, error_scale, number, scaled, tested_part
from hil.app.write import check_folder, write_files
from models.identification.result import STAGES, Finding
from models.rig import read_rig
from models.sets import measured_path
from plant.series import make_series

SIMULATED_EFFECT, SIMULATED_SECONDS, SIMULATED_SEED = "fold_periodic", 30.0, 7


@dataclass(frozen=True)
class Story:
    """One closed loop of the demo: `prepare` puts `rig.toml` and the records into a folder and names the latter."""

    name: str
    title: str
    prepare: Callable[[Path], tuple[list[Path], list[Path]]]


def _printed(measurement: str, rig: str) -> Callable[[Path], tuple[list[Path], list[Path]]]:
    def prepare(folder: Path) -> tuple[list[Path], list[Path]]:
        record = folder / f"{measurement}.csv"
        write_files({folder / "rig.toml": rig, record: measured_path(measurement).read_bytes()})
        return [record], []

    return prepare


def _simulated(folder: Path) -> tuple[list[Path], list[Path]]:
    make_series("pull", SIMULATED_EFFECT, SIMULATED_SEED, folder, SIMULATED_SECONDS)
    return [folder / f"train_{i}.csv.gz" for i in (1, 2, 3)], [folder / "holdout.csv.gz"]


STORIES = (
    Story(
        "periods",
        "measured: eight stick-slip periods (paper A, Table 2)",
        _printed("analytical_table2_periods", '[rig]\nkind = "periods"\nvelocity_m_s = 0.5e-3\n'),
    ),
    Story(
        "spectrum",
        "measured: moduli of three gut samples (paper V, Table 2)",
        _printed("viscoelastic_table2_dma", '[rig]\nkind = "dma"\n'),
    ),
    Story("simulated_pull", "simulated: a pull through a gut with an undeclared effect", _simulated),
)


def demo(out: Path, *, json_output: bool = False, seed: int = 0) -> None:
    """Close the loop on every story and print the errors before and after; the reports go to a folder each under `out`."""
    began = time.monotonic()
    check_folder(out, "--out")
    findings: list[tuple[Story, Path, Finding]] = []
    for story in STORIES:
        folder = check_folder(out / story.name, "--out")
        notes().print(story.title, markup=False, style="bold")
        records, holdout = story.prepare(folder)
        rig = read_rig(folder / "rig.toml")
        findings.append((story, folder, find_and_write(rig, *read_series(records, holdout, rig), folder, story.name, seed)))
    seconds = time.monotonic() - began
    if json_output:
        print_json({"stories": [_numbers(*row) for row in findings], "seconds": seconds})
    else:
        _print(findings, seconds)


def _print(findings: list[tuple[Story, Path, Finding]], seconds: float) -> None:
    console = summary()
    table = Table(title="Error before and after", title_justify="left", show_lines=True)
    table.add_column("story")
    for column in (*(STAGE_WORDS[stage] for stage in STAGES), "noise floor"):
        table.add_column(column, justify="right")
    table.add_column("verdict")
    for story, _, finding in findings:
        factor, unit = error_scale(finding)
        part = tested_part(finding)
        where = "held out" if part == "holdout" else "training"
        cells = [f"{number(scaled(finding.error[part].get(stage), factor), 3)} {unit}" for stage in STAGES]
        table.add_row(f"{story.title} ({where})", *cells, f"{number(factor * finding.noise_floor, 3)} {unit}", headline(finding))
    console.print(table)
    for story, folder, _ in findings:
        hidden = _hidden(folder)
        console.print(f"{story.name}: {folder / REPORT}", markup=False, soft_wrap=True)
        if hidden:
            console.print(f"  what the simulator kept to itself: {hidden}", markup=False)
    console.print(f"{seconds:.0f} s", markup=False)


def _numbers(story: Story, folder: Path, finding: Finding) -> dict[str, Any]:
    hidden = _hidden(folder)
    return {"story": story.name, "title": story.title, "report": str(folder / REPORT), "hidden": hidden, **report_json(finding)}


def _hidden(folder: Path) -> str | None:
    answer = folder / "answer.toml"
    return str(tomllib.loads(answer.read_text(encoding="utf-8"))["effect"]) if answer.is_file() else None
