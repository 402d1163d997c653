"""Figures of the outcome: the error by stage, and the candidates with their evidence."""

import math
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.report.theme import FLOOR, MUTED, STAGE_COLOURS, styled
from hil.report.words import PARTS, column_words, error_scale
from models.effects import effect_words
from models.identification.finding import STAGES, CandidateRow, Finding
from models.words.quantities import number

MOST_ROUNDS, MOST_CANDIDATES = 4, 14  # of the search, and candidates of each
_ROOM = 88  # px between rounds
_GAIN = "fitted, on data left out"
CHOSEN, ALIKE, OTHER = STAGE_COLOURS["augmented"], "#4a9aa0", "#8793a1"


def error_figure(finding: Finding) -> go.Figure:
    """Bars of the error by stage for training and held-out data, with the noise floor."""
    parts = [part for part in PARTS if any(_finite(v) for v in finding.error.get(part, {}).values())]
    values = [v for part in parts for v in finding.error[part].values() if _finite(v)]
    factor, unit = error_scale(finding)
    words = f"of the {column_words(finding.quantity)[0]} " if len(finding.columns) == 1 else ""
    wide = bool(values) and min(values) > 0 and max(values) / min(values) > 40
    figure = go.Figure()
    for stage in STAGES:
        heights = [factor * finding.error[part].get(stage, math.nan) for part in parts]
        hover = f"%{{x}}, {stage}: %{{y:.4g}} {unit}<extra></extra>"
        figure.add_bar(x=[PARTS[part] for part in parts], y=heights, hovertemplate=hover, **stage_bar(stage, heights))
    if _finite(finding.noise_floor) and finding.noise_floor > 0:
        level = factor * finding.noise_floor
        line = {"color": FLOOR, "dash": "dash", "width": 1.5}
        figure.add_hline(y=level, line=line, name="noise floor", showlegend=True)
    styled(figure, 340, barmode="group", bargap=0.35, bargroupgap=0.08).update_xaxes(title="records")
    title = f"error {words}in {unit}" if unit else f"error {words}as a ratio"
    return figure.update_yaxes(title=title, type="log" if wide else "linear", rangemode="tozero")


def stage_bar(stage: str, heights: list[float]) -> dict[str, Any]:
    """The look of the bars of a stage, each with its number above it."""
    look = {"name": stage, "marker": {"color": STAGE_COLOURS[stage], "cornerradius": 3}}
    return look | {"text": [number(h, 3) for h in heights], "textposition": "outside", "cliponaxis": False}


def candidate_figure(finding: Finding) -> go.Figure | None:
    """For each round the share that a candidate explains when screened, and the gain of a fitted one on new data."""
    rounds = sorted({row.round for row in finding.candidates})[:MOST_ROUNDS]
    if not rounds:
        return None
    shown = {index: _best(finding, index) for index in rounds}
    sizes = [len(rows) for rows in shown.values()]
    figure = make_subplots(
        rows=len(rounds),
        cols=2,
        shared_yaxes=True,
        horizontal_spacing=0.04,
        vertical_spacing=_ROOM / _height(sizes),
        row_heights=[max(size, 3) for size in sizes],
        subplot_titles=[t for k in rounds for t in (f"round {k}: screened", _GAIN)],
    )
    for panel, rows in enumerate(shown.values(), start=1):
        names = [effect_words(row.id) for row in rows]
        colours = [_colour(finding, row.id) for row in rows]
        notes = [row.note for row in rows]
        for column, values in enumerate(([100 * row.screened for row in rows], [row.gain for row in rows]), start=1):
            here = {"orientation": "h", "showlegend": False, "row": panel, "col": column}
            hover = {"customdata": notes, "hovertemplate": "%{y}: %{x:.3g}<br>%{customdata}<extra></extra>"}
            figure.add_bar(x=values, y=names, marker={"color": colours, "cornerradius": 2}, **hover, **here)
        figure.update_xaxes(title="share of the residual in %", rangemode="tozero", row=panel, col=1)
        figure.update_xaxes(title="gain, ln of a ratio", row=panel, col=2)
    styled(figure, _height(sizes), bargap=0.28, margin={"l": 165, "r": 20, "t": 34, "b": 40})
    return figure.update_yaxes(autorange="reversed", tickfont={"color": MUTED}, ticklabelstandoff=6)


def _height(sizes: list[int]) -> int:
    return 80 + sum(24 * max(size, 3) + _ROOM for size in sizes)


def _best(finding: Finding, index: int) -> list[CandidateRow]:
    rows = [row for row in finding.candidates if row.round == index]
    rows.sort(key=lambda row: (row.gain is None, -(row.gain or 0.0), -row.screened))
    return rows[:MOST_CANDIDATES]


def _colour(finding: Finding, effect: str) -> str:
    if any(effect == found.id for found in finding.effects):
        return CHOSEN
    return ALIKE if any(effect in found.equivalent for found in finding.effects) else OTHER


def _finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)
