"""Figure of the residual against whatever it may depend on, before and after."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from hil.report.panels import Array, Panel, binned
from hil.report.quantities import scale
from hil.report.theme import QUANTITY_COLOURS, STAGE_COLOURS, styled
from hil.report.words import column_words

MOST_POINTS = 900  # of a panel
SPEED = "v_m_s"


def residual_figure(drawn: Sequence[Panel], before: str, after: str) -> go.Figure | None:
    """Measured minus predicted over every signal: left with the stage `before`, right with `after`; lines are local
    means.

    Several measured quantities are drawn together as per cent of their mean size.
    """
    names = list(dict.fromkeys(name for panel in drawn for name in panel.signals))
    quantities = list(dict.fromkeys(panel.quantity for panel in drawn))
    if not names:
        return None
    rests = {stage: {q: _rest(drawn, q, stage, len(quantities) > 1) for q in quantities} for stage in (before, after)}
    everything = np.concatenate([values for by_quantity in rests.values() for values in by_quantity.values()])
    factor, unit = (
        (1.0, "%") if len(quantities) > 1 else scale([float(np.nanquantile(np.abs(everything), 0.99))], drawn[0].unit)
    )
    limit = 1.15 * factor * float(np.nanquantile(np.abs(everything), 0.995))
    figure = make_subplots(
        rows=len(names),
        cols=2,
        shared_yaxes=True,
        horizontal_spacing=0.03,
        vertical_spacing=58 / (60 + 225 * len(names)),
        column_titles=[f"before: {before} model", f"after: {after} model"],
    )
    for row, name in enumerate(names, start=1):
        words, signal_unit = column_words(name)
        for column, stage in enumerate((before, after), start=1):
            for number, quantity in enumerate(quantities):
                colour = (
                    STAGE_COLOURS[stage] if len(quantities) == 1 else QUANTITY_COLOURS[number % len(QUANTITY_COLOURS)]
                )
                signal = np.concatenate([panel.signals[name] for panel in drawn if panel.quantity == quantity])
                _cloud(figure, signal, factor * rests[stage][quantity], quantity, colour, (row, column))
                for way, dash in _ways(drawn, quantity, name):
                    centres, means = binned(signal[way], factor * rests[stage][quantity][way])
                    look: dict[str, Any] = {
                        "mode": "lines+markers",
                        "line": {"color": colour, "width": 2, "dash": dash},
                    }
                    look |= {"marker": {"size": 4}, "name": quantity, "showlegend": False}
                    figure.add_scatter(x=centres, y=means, row=row, col=column, **look)
            signal_factor, prefixed = scale(np.concatenate([panel.signals[name] for panel in drawn]), signal_unit)
            for trace in figure.select_traces(row=row, col=column):
                trace.x = signal_factor * np.asarray(trace.x)
            figure.update_xaxes(title=f"{words} in {prefixed}" if prefixed else words, row=row, col=column)
        figure.update_yaxes(title=f"residual in {unit}", range=[-limit, limit], row=row, col=1)
        figure.update_yaxes(range=[-limit, limit], row=row, col=2)
    if len(quantities) > 1:
        seen: set[str] = set()
        for trace in figure.data:
            if trace.mode != "markers" and trace.name not in seen:
                seen.add(trace.name)
                trace.showlegend = True
    styled(figure, 60 + 225 * len(names), legend={"orientation": "h", "x": 0, "y": 1.05, "yanchor": "bottom"})
    return figure


def _rest(drawn: Sequence[Panel], quantity: str, stage: str, relative: bool) -> Array:
    parts = [(panel.measured, panel.measured - panel.predicted[stage]) for panel in drawn if panel.quantity == quantity]
    rest = np.concatenate([left for _, left in parts])
    return 100 * rest / float(np.mean(np.abs(np.concatenate([m for m, _ in parts])))) if relative else rest


def _cloud(figure: go.Figure, signal: Array, rest: Array, name: str, colour: str, place: tuple[int, int]) -> None:
    good = np.isfinite(signal) & np.isfinite(rest)
    signal, rest = signal[good], rest[good]
    if not len(signal):
        return
    some = np.arange(len(signal))
    if len(some) > MOST_POINTS:
        some = np.sort(np.random.default_rng(0).choice(some, MOST_POINTS, replace=False))
    row, col = place
    marker = {"color": colour, "size": 4 if len(some) > 100 else 7, "opacity": 0.28 if len(some) > 100 else 0.6}
    points = {"x": signal[some].astype(np.float32), "y": rest[some].astype(np.float32), "marker": marker}
    figure.add_scatter(**points, mode="markers", name=name, showlegend=False, hoverinfo="skip", row=row, col=col)


def _ways(drawn: Sequence[Panel], quantity: str, name: str) -> list[tuple[NDArray[np.bool_], str]]:
    """The samples that share a local mean, with the line's dash: forward and backward motion apart where the record
    tells.
    """
    some = [panel for panel in drawn if panel.quantity == quantity]
    size = sum(len(panel.measured) for panel in some)
    if SPEED not in some[0].signals or name in (SPEED, "t_s"):
        return [(np.ones(size, dtype=bool), "solid")]
    speed = np.concatenate([panel.signals[SPEED] for panel in some])
    least = 0.02 * float(np.nanmax(np.abs(speed)))
    ways = ((speed > least, "solid"), (speed < -least, "dot"))
    return [(way, dash) for way, dash in ways if np.count_nonzero(way) > 50] or [(np.ones(size, dtype=bool), "solid")]
