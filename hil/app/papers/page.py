"""One self-contained page with the papers' figures."""

from __future__ import annotations

from html import escape
from pathlib import Path

import plotly.io as pio

from hil.app.papers.draw_analytical import analytical_drawings
from hil.app.papers.draw_flat_car import flat_car_drawing
from hil.app.papers.draw_two_speeds import two_speeds_drawing
from hil.app.papers.draw_viscoelastic import viscoelastic_drawings
from hil.app.papers.drawing import Drawing

PAGE_NAME = "seeds.html"
_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1f2937; background: #f6f7f9; margin: 0; }
main { max-width: 62rem; margin: 0 auto; padding: 2rem 1rem 4rem; }
h1 { font-size: 1.7rem; margin: 0 0 .5rem; }
section { background: #fff; border: 1px solid #e5e7eb; border-radius: 10px; padding: 1.2rem 1.4rem; margin: 1.4rem 0; }
h2 { font-size: 1.1rem; margin: 0 0 .4rem; }
p { margin: .4rem 0 0; }
.caption { color: #4b5563; font-size: .93rem; }
"""
_LEAD = (
    "What the three seed papers draw, recomputed from their printed equations and parameters. Black and grey marks are "
    "measurements that the papers print as numbers; everything else is computed when this page is made."
)


def drawings() -> list[Drawing]:
    """All figures: A Fig. 5-7, V Fig. 5, 7, 9 and Table 2, C Fig. 8, and the base model at two speeds."""
    return [*analytical_drawings(), *viscoelastic_drawings(), flat_car_drawing(), two_speeds_drawing()]


def write_page(folder: Path) -> Path:
    """Write `seeds.html` into `folder`, which is made if needed, and return its path."""
    parts = []
    for i, drawing in enumerate(drawings()):
        config = {"displayModeBar": False, "responsive": True}
        plot = pio.to_html(
            drawing.figure, full_html=False, include_plotlyjs=i == 0, config=config, div_id=f"figure-{i + 1}"
        )
        caption = f'<p class="caption">{escape(drawing.caption)}</p>'
        parts.append(f"<section><h2>{escape(drawing.title)}</h2>{plot}{caption}</section>")
    head = f'<meta charset="utf-8"><title>The seed papers\' figures</title><style>{_STYLE}</style>'
    body = f"<main><h1>The seed papers' figures</h1><p>{escape(_LEAD)}</p>{''.join(parts)}</main>"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / PAGE_NAME
    path.write_text(f'<!doctype html><html lang="en"><head>{head}</head><body>{body}</body></html>', encoding="utf-8")
    return path
