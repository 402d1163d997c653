"""What the residual of an `unknown` depends on, and the term that is proposed for it, in words and figures."""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.report.theme import STAGE_COLOURS, styled
from hil.report.words import SHOWN_SHARE, TEXT, column_words
from models.identification.finding import Dependence, ResidualCurve
from models.words.quantities import scale

_SHOWN = 4  # curves in the list
_OVER = {"+x": "over", "-v": "resistance"}
_BAND = "rgba(14, 132, 144, 0.25)"


def dependence_words(found: Dependence) -> list[str]:
    """What the residual depends on, in sentences for page and terminal."""
    best, surface, tone, term = _best(found), found.surface, found.tone, found.term
    over = [TEXT(f"depends.{_OVER[c.along]}", share=c.share, variable=column_words(c.variable)[0]) for c in best]
    said = [TEXT("depends.curves", curves=over) if over else TEXT("depends.none")]
    if surface is not None:
        names = [column_words(name)[0] for name in surface.variables]
        said.append(TEXT("depends.surface", variables=names, share=surface.share))
    if tone is not None:
        said.append(TEXT("depends.tone", share=tone.share, frequency=tone.frequency_Hz))
    if term is not None and found.inside is not None:
        before, after = found.inside
        said.append(TEXT("depends.inside", variable=column_words(term.variable)[0], before=before, after=after))
    if term is not None:
        said.append(TEXT("depends.term", form=TEXT(f"form.{term.form}"), text=term.text))
    return said


def _best(found: Dependence) -> list[ResidualCurve]:
    return [curve for curve in found.curves if curve.share >= SHOWN_SHARE][:_SHOWN]


def curves_figure(found: Dependence) -> go.Figure | None:
    """The curves that predict most, each with its 95 % interval."""
    shown = _best(found)
    if not shown:
        return None
    factor, unit = scale(np.concatenate([c.values for c in shown]), found.unit)
    figure = make_subplots(rows=1, cols=len(shown), shared_yaxes=True, horizontal_spacing=0.03)
    for col, curve in enumerate(shown, start=1):
        words, own = column_words(curve.variable)
        along, prefixed = scale(curve.centres, own)
        x = along * curve.centres
        here = {"x": x, "showlegend": False, "row": 1, "col": col}
        band = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip", **here}
        figure.add_scatter(y=factor * curve.low, **band)
        figure.add_scatter(y=factor * curve.high, fill="tonexty", fillcolor=_BAND, **band)
        line = {"color": STAGE_COLOURS["augmented"], "width": 2}
        figure.add_scatter(y=factor * curve.values, mode="lines+markers", line=line, marker={"size": 4}, **here)
        size = "size of " if curve.sized else ""
        figure.update_xaxes(title=f"{size}{words} in {prefixed}", row=1, col=col)
    name = "residual resistance" if all(curve.along == "-v" for curve in shown) else found.quantity
    return styled(figure, 320).update_yaxes(title=f"{name} in {unit}", row=1, col=1)


def surface_figure(found: Dependence) -> go.Figure | None:
    """The residual over two signals, where they matter together."""
    surface = found.surface
    if surface is None:
        return None
    factor, unit = scale(surface.values[np.isfinite(surface.values)], found.unit)
    ends = [scale(c, column_words(n)[1]) for c, n in zip(surface.centres, surface.variables, strict=True)]
    figure = go.Figure(
        go.Heatmap(
            x=ends[0][0] * surface.centres[0],
            y=ends[1][0] * surface.centres[1],
            z=factor * surface.values.T,
            customdata=factor * surface.half.T,
            colorscale="RdBu",
            zmid=0,
            colorbar={"title": {"text": f"in {unit}", "side": "right"}, "thickness": 14},
            hovertemplate=f"%{{z:.3g}} +- %{{customdata:.2g}} {unit}<extra></extra>",
        )
    )
    styled(figure, 380)
    for update, (_, own), name in zip((figure.update_xaxes, figure.update_yaxes), ends, surface.variables, strict=True):
        update(title=f"{column_words(name)[0]} in {own}")
    return figure
