"""Figures over signals: the residual before and after, what it depends on; of runs, measured and predicted speed."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from hil.report.figure_traces import Panel, binned, largest, pooled
from hil.report.theme import INK, MUTED, STAGE_COLOURS, Array, axes, grid, line_colour, styled
from hil.report.words import SHOWN_SHARE, TEXT, column_words
from models.identification.finding import Dependence, ResidualCurve
from models.words.quantities import scale

MOST_POINTS = 900  # of a panel
SPEED = "v_m_s"


def residual_figure(drawn: Sequence[Panel], before: str, after: str) -> go.Figure | None:
    """Measured minus predicted over every signal: left with the stage `before`, right with `after`; lines are local
    means.

    Several measured quantities are drawn together as per cent of their mean size.
    """
    names = list(dict.fromkeys(name for panel in drawn for name in panel.signals))
    if not names:
        return None
    pools = [pooled([p for p in drawn if p.quantity == name]) for name in dict.fromkeys(p.quantity for p in drawn)]
    several = len(pools) > 1
    sizes = [100 / float(np.mean(np.abs(pool.measured))) if several else 1.0 for pool in pools]
    rests = {
        stage: [size * (pool.measured - pool.predicted[stage]) for size, pool in zip(sizes, pools, strict=True)]
        for stage in (before, after)
    }
    everything = np.abs(np.concatenate(rests[before] + rests[after]))
    factor, unit = (1.0, "%") if several else scale([float(np.nanquantile(everything, 0.99))], drawn[0].unit)
    titles = [f"before: {before} model", f"after: {after} model"]
    figure = grid(len(names), 2, 72 / (60 + 240 * len(names)), column_titles=titles)
    for row, name in enumerate(names, start=1):
        words, own = column_words(name)
        along, prefixed = scale((largest(pool.signals[name]) for pool in pools), own)
        for column, stage in enumerate((before, after), start=1):
            here = {"row": row, "col": column}
            for number, (pool, rest) in enumerate(zip(pools, rests[stage], strict=True)):
                colour = line_colour(number) if several else STAGE_COLOURS[stage]
                _cloud(figure, along * pool.signals[name], factor * rest, colour, pool.quantity, **here)
                for k, (part, dash) in enumerate(_directions(pool, name)):
                    centres, means = binned(along * pool.signals[name][part], factor * rest[part])
                    look: dict[str, Any] = {"line": {"color": colour, "width": 2, "dash": dash}, "marker": {"size": 4}}
                    look |= {"name": pool.quantity, "showlegend": several and (row, column, k) == (1, 1, 0)}
                    figure.add_scatter(x=centres, y=means, mode="lines+markers", **look, **here)
            figure.update_xaxes(title=f"{words} in {prefixed}" if prefixed else words, **here)
        figure.update_yaxes(title=f"residual in {unit}", row=row, col=1)
    limit = 1.15 * factor * float(np.nanquantile(everything, 0.995))
    figure.update_yaxes(range=[-limit, limit])
    return styled(figure, 60 + 240 * len(names), legend={"orientation": "h", "x": 0, "y": 1.05, "yanchor": "bottom"})


def _cloud(figure: go.Figure, signal: Array, rest: Array, colour: str, name: str, **here: int) -> None:
    good = np.flatnonzero(np.isfinite(signal) & np.isfinite(rest))
    if not len(good):
        return
    if len(good) > MOST_POINTS:
        good = np.sort(np.random.default_rng(0).choice(good, MOST_POINTS, replace=False))
    marker = {"color": colour, "size": 4 if len(good) > 100 else 7, "opacity": 0.28 if len(good) > 100 else 0.6}
    points = {"x": signal[good].astype(np.float32), "y": rest[good].astype(np.float32), "marker": marker}
    figure.add_scatter(**points, mode="markers", name=name, showlegend=False, hoverinfo="skip", **here)


def _directions(pool: Panel, name: str) -> list[tuple[NDArray[np.bool_], str]]:
    """The samples that share a local mean, with the line's dash; forward and backward motion apart where the speed is
    known.
    """
    all_of_them = [(np.ones(len(pool.measured), dtype=bool), "solid")]
    if SPEED not in pool.signals or name in (SPEED, "t_s"):
        return all_of_them
    speed = pool.signals[SPEED]
    least = 0.02 * float(np.nanmax(np.abs(speed)))
    parts = ((speed > least, "solid"), (speed < -least, "dot"))
    return [(part, dash) for part, dash in parts if np.count_nonzero(part) > 50] or all_of_them


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
    figure = grid(1, len(means), subplot_titles=titles)
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
    figure = axes(f"measured {drawn[0].quantity} in {unit}", f"predicted {drawn[0].quantity} in {unit}", 420)
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
    figure = grid(1, len(shown))
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
