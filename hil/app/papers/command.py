"""The command `capsule seeds`: table or JSON, and the figures."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from hil.app.console import print_json
from hil.app.papers.page import write_page
from hil.app.papers.table import print_rows, seed_rows

_PAGE_WIDTH = 120


def seeds(json_output: bool = False, plot: Path | None = None) -> None:
    """Print the table, or with `json_output` one JSON object with the list `rows`; with `plot` draw the figures into
    that folder.

    A row is `{id, quantity, unit, paper, computed, measured, verdict, note}`. `ValueError` if `plot` is a file.
    """
    if plot is not None and plot.exists() and not plot.is_dir():
        raise ValueError(f"--plot must be a folder; got the file {plot}")
    rows = seed_rows()
    page = None if plot is None else write_page(plot)
    if json_output:
        print_json({"rows": [r.record() for r in rows], "figures": None if page is None else str(page)})
        return
    console = Console()
    if not console.is_terminal:
        console.width = _PAGE_WIDTH
    print_rows(rows, console)
    if page is not None:
        console.print(f"figures: {page}", soft_wrap=True)
