"""All rows in the papers' order, and their rich table."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from hil.app.papers.analytical import analytical_rows
from hil.app.papers.dma import dma_rows
from hil.app.papers.flat_car import flat_car_rows
from hil.app.papers.row import Row
from hil.app.papers.two_speeds import two_speeds_rows
from hil.app.papers.viscoelastic import base_rows, viscoelastic_rows

_COLOURS = {
    "reproduced": "green",
    "consistent": "green",
    "check value": "dim",
    "not comparable": "dim",
    "misprint": "yellow",
    "finding": "cyan",
    "not reproducible": "red",
    "misses the measurement": "red",
}


def seed_rows() -> list[Row]:
    """Every row, computed now."""
    return [*analytical_rows(), *flat_car_rows(), *viscoelastic_rows(), *dma_rows(), *base_rows(), *two_speeds_rows()]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:#.4g}".rstrip(".")


def print_rows(rows: list[Row], console: Console) -> None:
    """One table; notes are numbered and follow it."""
    notes: dict[str, int] = {}
    table = Table(title="The seed papers' numbers", box=SIMPLE_HEAD, pad_edge=False)
    for name in ("quantity", "unit", "paper", "computed", "measured", "verdict", "note"):
        numeric = name in ("paper", "computed", "measured", "note")
        table.add_column(name, justify="right" if numeric else "left", no_wrap=numeric)
    group = ""
    for r in rows:
        if group and r.id.split("_")[0] != group:
            table.add_section()
        group = r.id.split("_")[0]
        number = str(notes.setdefault(r.note, len(notes) + 1)) if r.note else ""
        verdict = f"[{_COLOURS[r.verdict]}]{r.verdict}[/]"
        numbers = (_number(v) for v in (r.paper, r.computed, r.measured))
        table.add_row(r.quantity, r.unit, *numbers, verdict, number)
    console.print(table)
    legend = Table.grid(padding=(0, 2))
    for note, index in notes.items():
        legend.add_row(f"{index:3d}", note)
    console.print(legend, markup=False, highlight=False)
