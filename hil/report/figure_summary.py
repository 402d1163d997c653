"""Figures of the outcome: the error by stage, the candidates with their evidence, and profile likelihoods."""

import math
from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import plotly.graph_objects as go

from hil.report.theme import FLOOR, MUTED, STAGE_COLOURS, grid, styled
from hil.report.words import PARTS, column_words, error_scale, parameter_words
from models.effects import effect_words
from models.identification.finding import STAGES, Finding, Profile
from models.identification.profile import LINE
from models.words.quantities import number, scale, unit_words

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
    ranked = sorted(finding.candidates, key=lambda row: (row.gain is None, -(row.gain or 0.0), -row.screened))
    shown = {index: [row for row in ranked if row.round == index][:MOST_CANDIDATES] for index in rounds}
    sizes = [len(rows) for rows in shown.values()]
    look: dict[str, Any] = {"row_heights": [max(size, 3) for size in sizes]}
    look |= {"subplot_titles": [t for k in rounds for t in (f"round {k}: screened", _GAIN)]}
    figure = grid(len(rounds), 2, _ROOM / _height(sizes), 0.04, **look)
    colour = {name: ALIKE for effect in finding.effects for name in effect.equivalent}
    colour |= {effect.id: CHOSEN for effect in finding.effects}
    for panel, rows in enumerate(shown.values(), start=1):
        names = [effect_words(row.id) for row in rows]
        colours = [colour.get(row.id, OTHER) for row in rows]
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


def _finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


COLUMNS, HIGHEST = 3, 3.0  # panels side by side; times the 95 % line that is drawn
_WIDEST = 28  # characters of a title


def profile_figure(profiles: Sequence[Profile]) -> go.Figure | None:
    """A panel a parameter: the drop of the log-likelihood over its value, the 95 % line, and where it was fitted."""
    if not profiles:
        return None
    rows = -(-len(profiles) // COLUMNS)
    height = 60 + 240 * rows
    below, titles = 124 / height if rows > 1 else 0.0, [_title(one) for one in profiles]
    figure = grid(rows, COLUMNS, below, 0.07, subplot_titles=titles)
    for k, one in enumerate(profiles):
        at = {"row": k // COLUMNS + 1, "col": k % COLUMNS + 1}
        factor, unit = scale(one.values, one.unit)
        flat = max(one.drops) < LINE
        look = {"color": FLOOR if flat else STAGE_COLOURS["augmented"], "width": 2}
        values = [factor * value for value in one.values]
        hover = f"%{{x:.4g}} {unit}: %{{y:.3g}}<extra></extra>"
        figure.add_scatter(
            x=values, y=one.drops, mode="lines+markers", line=look, showlegend=False, hovertemplate=hover, **at
        )
        figure.add_hline(y=LINE, line={"color": FLOOR, "dash": "dash", "width": 1.2}, **at)
        figure.add_vline(x=factor * one.value, line={"color": MUTED, "width": 1}, **at)
        words = parameter_words(one.name.rpartition(".")[2])
        figure.update_xaxes(title_text=f"{words} in {unit_words(unit)}" if unit != "1" else words, nticks=4, **at)
    styled(figure, height, margin={"l": 60, "r": 20, "t": 48, "b": 56})
    figure.update_yaxes(range=[-0.2, HIGHEST * LINE])
    return figure.update_yaxes(title_text="drop of ln L", col=1)


def _title(one: Profile) -> str:
    effect, _, own = one.name.rpartition(".")
    words = parameter_words(own) + (f", {effect_words(effect)}" if effect else "")
    flat = "flat" if max(one.drops) < LINE else f"no {' or '.join(one.unshown)} end" if one.unshown else ""
    return "<br>".join(wrap(f"{words} ({flat})" if flat else words, _WIDEST))
