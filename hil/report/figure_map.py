"""Figure of a table of runs: measured and predicted speed over drive period and duty."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.report.panels import Panel, pooled
from hil.report.theme import INK, MUTED, STAGE_COLOURS, axes, styled
from models.words.quantities import scale


def speed_map(drawn: Sequence[Panel], last: str) -> go.Figure | None:
    """Maps of the measurement, the nominal model and the stage `last`: a dot a condition, coloured by speed."""
    drawn = [panel for panel in drawn if {"period_s", "duty"} <= set(panel.signals)]
    if not drawn:
        return None
    pool = pooled(drawn)
    columns = {"measured": pool.measured} | {stage: pool.predicted[stage] for stage in ("nominal", last)}
    unique, index = np.unique(
        np.column_stack((pool.signals["period_s"], pool.signals["duty"])).round(9), axis=0, return_inverse=True
    )
    counts = np.bincount(index.ravel())
    means = {name: np.bincount(index.ravel(), weights=values) / counts for name, values in columns.items()}
    factor, unit = scale(columns["measured"], drawn[0].unit)
    limit = factor * float(np.nanmax(np.abs(means["measured"])))
    titles = [name if name == "measured" else f"{name} model" for name in means]
    figure = make_subplots(rows=1, cols=len(means), shared_yaxes=True, horizontal_spacing=0.03, subplot_titles=titles)
    edge = {"color": INK, "width": 0.7}
    for column, values in enumerate(means.values(), start=1):
        figure.add_scatter(
            x=1e3 * unique[:, 0],
            y=unique[:, 1],
            mode="markers",
            marker={"color": factor * values, "coloraxis": "coloraxis", "size": 11, "line": edge},
            hovertemplate=f"T %{{x:.3g}} ms, duty %{{y:.2f}}: %{{marker.color:.3g}} {unit}<extra></extra>",
            **{"showlegend": False, "row": 1, "col": column},
        )
        figure.update_xaxes(title="drive period in ms", row=1, col=column)
    figure.update_yaxes(title="duty", row=1, col=1)
    bar = {"title": {"text": f"speed in {unit}", "side": "right"}, "thickness": 14, "outlinewidth": 0}
    return styled(
        figure, 400, coloraxis={"colorscale": "RdBu", "cmin": -limit, "cmax": limit, "colorbar": bar}, margin={"r": 90}
    )


def agreement_figure(drawn: Sequence[Panel], last: str) -> go.Figure:
    """Predicted against measured for the nominal model and the stage `last`; a right model lies on the line."""
    measured = pooled(drawn).measured
    factor, unit = scale(measured, drawn[0].unit)
    figure = axes(f"measured {drawn[0].quantity} in {unit}", f"predicted in {unit}", 420)
    ends = factor * np.array([measured.min(), measured.max()])
    line = {"color": MUTED, "dash": "dash", "width": 1}
    figure.add_scatter(x=ends, y=ends, mode="lines", line=line, showlegend=False, hoverinfo="skip")
    for stage in dict.fromkeys(("nominal", last)):
        for role, symbol in (("train", "circle"), ("holdout", "diamond-open")):
            some = [panel for panel in drawn if (panel.role == "holdout") == (role == "holdout")]
            if some:
                pool, name = pooled(some), stage + (", held out" if role == "holdout" else "")
                marker = {"color": STAGE_COLOURS[stage], "symbol": symbol, "size": 8, "opacity": 0.85}
                x, y = factor * pool.measured, factor * pool.predicted[stage]
                figure.add_scatter(x=x, y=y, mode="markers", name=name, marker=marker)
    return figure
