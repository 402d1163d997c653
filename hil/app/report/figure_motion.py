"""The figure of a proposed motion: place over time."""

from __future__ import annotations

import plotly.graph_objects as go

from hil.app.report.theme import STAGE_COLOURS, styled
from hil.app.report.words import column_words
from models.identification.finding import Proposal


def motion_figure(proposal: Proposal) -> go.Figure:
    """The waypoints of `proposal`, in mm over s."""
    figure = go.Figure()
    figure.add_scatter(
        x=proposal.times_s,
        y=1e3 * proposal.places_m,
        mode="lines+markers",
        line={"color": STAGE_COLOURS["augmented"], "width": 2},
        marker={"size": 5},
        hovertemplate="%{x:.2f} s: %{y:.3f} mm<extra></extra>",
        showlegend=False,
    )
    styled(figure, 260)
    figure.update_xaxes(title="time in s")
    return figure.update_yaxes(title=f"{column_words(proposal.column)[0]} in mm")
