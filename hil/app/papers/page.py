"""One self-contained page with the papers' figures."""

from __future__ import annotations

from html import escape
from pathlib import Path

from hil.app.papers.draw_analytical import analytical_drawings
from hil.app.papers.draw_flat_car import flat_car_drawing
from hil.app.papers.draw_two_speeds import two_speeds_drawing
from hil.app.papers.draw_viscoelastic import viscoelastic_drawings
from hil.app.papers.drawing import Drawing
from hil.app.report.document import document, heading
from hil.app.report.theme import figure_html
from hil.app.write import write_files

PAGE_NAME = "seeds.html"
_LEAD = (
    "What the three seed papers draw, recomputed from their printed equations and parameters. Black and grey marks are "
    "measurements that the papers print as numbers; everything else is computed when this page is made."
)


def drawings() -> list[Drawing]:
    """All figures: A Fig. 5-7, V Fig. 5, 7, 9 and Table 2, C Fig. 8, and the base model at two speeds."""
    return [*analytical_drawings(), *viscoelastic_drawings(), flat_car_drawing(), two_speeds_drawing()]


def write_page(folder: Path) -> Path:
    """Write `seeds.html` into `folder`, which is made if needed, and return its path."""
    sections = [
        (
            f"figure-{i}-section",
            drawing.title,
            f'{figure_html(drawing.figure, f"figure-{i}")}<p class="caption">{escape(drawing.caption)}</p>',
        )
        for i, drawing in enumerate(drawings(), start=1)
    ]
    title = "The seed papers' figures"
    page = document(title, heading("Computed again from what the papers print", title, _LEAD), sections)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / PAGE_NAME
    write_files({path: page})
    return path
