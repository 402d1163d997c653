"""`capsule seeds`: the seed papers' numbers as table or JSON, and a page of their figures."""

from pathlib import Path
from typing import Annotated

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from hil.app.console import print_json
from hil.app.papers.analytical import analytical_drawings, analytical_rows
from hil.app.papers.comparison import Drawing, Row
from hil.app.papers.dma import dma_rows, moduli_drawing
from hil.app.papers.flat_car import flat_car_drawing, flat_car_rows
from hil.app.papers.two_speeds import two_speeds_drawing, two_speeds_rows
from hil.app.papers.viscoelastic import base_rows, viscoelastic_drawings, viscoelastic_rows
from hil.app.shared_options import Json, option
from hil.app.write import write_files
from hil.report.builder import page

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
    plot: Annotated[Path | None, option("--plot", "DIR", "Draw the papers' figures into this folder.")] = None,
) -> None:
    """Print the table, or the list `rows` as JSON; draw the figures.

    A row is `{id, quantity, unit, paper, computed, measured, verdict, note}`. `ValueError` if `plot` is a file.
    """
    if plot is not None and plot.exists() and not plot.is_dir():
        raise ValueError(f"--plot must be a folder; got the file {plot}")
    rows = seed_rows()
    drawn = None if plot is None else write_page(plot)
    if json_output:
        print_json({"rows": [r.record() for r in rows], "figures": None if drawn is None else str(drawn)})
        return
    console = Console()
    if not console.is_terminal:
        console.width = _PAGE_WIDTH
    print_rows(rows, console)
    if drawn is not None:
        console.print(f"figures: {drawn}", soft_wrap=True)


def seed_rows() -> list[Row]:
    """Every row, computed now."""
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
    return [
        *analytical_drawings(),
        *viscoelastic_drawings(),
        moduli_drawing(),
        flat_car_drawing(),
        two_speeds_drawing(),
    ]


def write_page(folder: Path) -> Path:
    """Write `seeds.html` into `folder`, which is made if needed, and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / PAGE_NAME
    write_files({path: page("seeds.html.j2", drawings=drawings())})
    return path
