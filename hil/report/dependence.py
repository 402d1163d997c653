"""What the residual of an `unknown` depends on, and the term that is proposed for it, in words and figures."""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.report.theme import STAGE_COLOURS, styled
from hil.report.words import column_words
from models.identification.finding import Dependence, ResidualCurve
from models.words.quantities import number, percent, scale
from models.words.sentences import listed

_SHOWN = 4  # curves in the list
_TELLS = 0.01  # share of the residual from which a curve is in it
_BAND = "rgba(14, 110, 115, 0.18)"
_FORMS = {
    "line": "a straight line",
    "parabola": "a parabola",
    "decay": "an exponential",
    "step": "a step with rounded edges",
    "bump": "a bump",
    "wave": "a wave",
    "line_and_decay": "a straight line and an exponential",
    "knots": "no short form: straight lines between knots",
}


def story(found: Dependence) -> list[str]:
    """What the residual depends on, in sentences for page and terminal."""
    said, surface, term = [_best(found)], found.surface, found.term
    if surface is not None:
        names = listed(column_words(name)[0] for name in surface.variables)
        said.append(f"Two signals matter together: a surface over {names} foretells {percent(surface.share)}.")
    if found.tone is not None:
        said.append(f"{percent(found.tone.share)} of its power is a tone of {number(found.tone.frequency_Hz, 3)} Hz.")
    if term is not None:
        said.append(f"Proposed term, {_FORMS[term.form]}: {term.text}, in {term.amplitude.unit} and SI units.")
    return said


def _best(found: Dependence) -> str:
    told = [c for c in found.curves if c.share >= _TELLS]
    if not told:
        return "No curve over one signal predicts the residual on stretches that it was not made on."
    rows = [f"{_over(c)} {percent(c.share)}" for c in told[:_SHOWN]]
    return f"Of the residual a curve predicts, on stretches it was not made on: {listed(rows)}."


def _over(curve: ResidualCurve) -> str:
    words, _ = column_words(curve.variable)
    return f"over {words}{', as a resistance,' if curve.along == '-v' else ''}"


def curves_figure(found: Dependence) -> go.Figure | None:
    """The curves that foretell most, each with its 95 % interval."""
    shown = [c for c in found.curves if c.share >= _TELLS][:_SHOWN]
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
    resisting = all(curve.along == "-v" for curve in shown)
    styled(figure, 320)
    return figure.update_yaxes(title=f"{'resistance left' if resisting else found.quantity} in {unit}", row=1, col=1)


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
