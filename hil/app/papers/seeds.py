"""`capsule seeds`: the seed papers' numbers as table or JSON, and a page of their figures."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from hil.app.console import print_json
from hil.app.papers.analytical import analytical_drawings, analytical_rows, mean_of
from hil.app.papers.comparison import MN, Drawing, Plot, Row, at_speed, row, slug
from hil.app.papers.dma import dma_rows, moduli_drawing
from hil.app.papers.flat_car import flat_car_drawing, flat_car_rows, measured_teeth
from hil.app.papers.viscoelastic import base_rows, measured_band, viscoelastic_drawings, viscoelastic_rows
from hil.app.shared_options import Json, option
from hil.app.write import write_files
from hil.report.builder import page
from models.identification.kinds.periods import Cycle, PeriodsKind
from models.rigs.benches import PERIODS
from models.rigs.rig import Rig
from models.sets import load_measurement

_PAGE_WIDTH = 120  # characters of a table in a file
_COLOURS = {
    **dict.fromkeys(("reproduced", "consistent"), "green"),
    **dict.fromkeys(("check value", "not comparable"), "dim"),
    **dict.fromkeys(("not reproducible", "misses the measurement"), "red"),
    **{"misprint": "yellow", "finding": "cyan"},
}
PAGE_NAME = "seeds.html"


def seeds(
    json_output: Json = False,
    plot: Annotated[Path | None, option("--plot", "DIR")] = None,
) -> None:
    """Print the table, or the list `rows` as JSON; draw the figures.

    A row is `{id, quantity, unit, paper, computed, measured, verdict, note}`. `ValueError` if `plot` is a file.
    """
    if plot is not None and plot.exists() and not plot.is_dir():
        raise ValueError(f"--plot must be a folder; got the file {plot}")
    rows = seed_rows()
    drawn = None if plot is None else write_page(plot)
    if json_output:
        print_json({"rows": [asdict(r) for r in rows], "figures": None if drawn is None else str(drawn)})
        return
    console = Console()
    if not console.is_terminal:
        console.width = _PAGE_WIDTH
    print_rows(rows, console)
    if drawn is not None:
        console.print(f"figures: {drawn}", soft_wrap=True)


def seed_rows() -> list[Row]:
    return [*analytical_rows(), *flat_car_rows(), *viscoelastic_rows(), *dma_rows(), *base_rows(), *two_speeds_rows()]


def print_rows(rows: list[Row], console: Console) -> None:
    """One table; notes are numbered and follow it."""
    notes: dict[str, int] = {}
    table = Table(title="The seed papers' numbers", box=SIMPLE_HEAD, pad_edge=False)
    for name in ("quantity", "unit", "paper", "computed", "measured", "verdict", "note"):
        numeric = name in ("paper", "computed", "measured", "note")
        table.add_column(name, justify="right" if numeric else "left", no_wrap=numeric)
    for before, r in zip([None, *rows], rows, strict=False):
        if before and before.id.split("_")[0] != r.id.split("_")[0]:
            table.add_section()
        note = str(notes.setdefault(r.note, len(notes) + 1)) if r.note else ""
        numbers = ("-" if v is None else f"{v:#.4g}".rstrip(".") for v in (r.paper, r.computed, r.measured))
        table.add_row(r.quantity, r.unit, *numbers, f"[{_COLOURS[r.verdict]}]{r.verdict}[/]", note)
    console.print(table)
    legend = Table.grid(padding=(0, 2))
    for note, index in notes.items():
        legend.add_row(f"{index:3d}", note)
    console.print(legend, markup=False, highlight=False)


def drawings() -> list[Drawing]:
    """All figures: A Fig. 5-7, V Fig. 5, 7, 9 and Table 2, C Fig. 8, and the base model at two speeds."""
    single = (moduli_drawing(), flat_car_drawing(), two_speeds_drawing())
    return [*analytical_drawings(), *viscoelastic_drawings(), *single]


def write_page(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / PAGE_NAME
    write_files({path: page("seeds.html.j2", drawings=drawings())})
    return path


SLOW, FAST = 0.5e-3, 10e-3  # m/s, papers A and C


def base_cycle(speed_m_s: float) -> Cycle:
    """The base model's tooth for the default capsule and gut, nothing fitted."""
    kind = PeriodsKind.from_rig(Rig(PERIODS.id, velocity_m_s=speed_m_s))
    return kind.cycle(speed_m_s, kind.nominal())


def two_speeds_rows() -> Iterator[Row]:
    measured = {
        SLOW: (mean_of("period_s"), mean_of("valley_N"), mean_of("peak_N")),
        FAST: (float(np.mean(measured_teeth("period"))), *measured_band()),
    }
    for v, values in measured.items():
        cycle, at = base_cycle(v), at_speed(v)
        computed = {"period": cycle.tooth.period_s, "valley": cycle.valley, "peak": cycle.peak}
        for (name, value), seen in zip(computed.items(), values, strict=True):
            differs = ("s", "misses the measurement", "two_speeds") if name == "period" else None
            own = f"base_{name}_{slug(at)}"
            yield row("base_cycle", value, measured=seen, own=own, differs=differs, name=name, at=at)


def two_speeds_drawing() -> Drawing:
    plot = Plot("", "")
    plot.figure.set_subplots(rows=1, cols=2)
    speeds = np.geomspace(0.3e-3, 20e-3, 60)
    cycles = [base_cycle(v) for v in speeds]
    plot.line(speeds * MN, [c.tooth.period_s for c in cycles], "base model: period", "printed", row=1, col=1)
    table, band = load_measurement("analytical_table2_periods"), measured_band()
    for speed, periods in ((SLOW, table["period_s"]), (FAST, np.array(measured_teeth("period")))):
        name = f"measured periods at {at_speed(speed)}"
        plot.points(np.full(len(periods), speed * MN), periods, name, "circle", row=1, col=1)
    for name, colour in (("valley", "derived"), ("peak", "third")):
        forces = np.array([getattr(c, name) for c in cycles]) * MN
        plot.line(speeds * MN, forces, f"base model: {name}", colour, row=1, col=2)
    for name, symbol, slow, fast in (
        ("valleys", "diamond", table["valley_N"], band[0]),
        ("peaks", "triangle-up", table["peak_N"], band[1]),
    ):
        x = np.append(np.full(len(slow), SLOW * MN), FAST * MN)
        plot.points(x, np.append(slow, fast) * MN, f"measured {name}", symbol, row=1, col=2)
    plot.figure.update_xaxes(title="speed, mm/s", type="log").update_yaxes(title="period, s", type="log", col=1)
    plot.figure.update_yaxes(title="force, mN", type="log", col=2)
    first, last = (base_cycle(speed).tooth.period_s for speed in (SLOW, FAST))
    return plot.captioned("two_speeds", slow=first, fast=last)
