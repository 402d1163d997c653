"""Figures of records, thinned so that every slip event stays visible: measured and predicted, residuals, columns."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import plotly.graph_objects as go

from hil.report.theme import INK, STAGE_COLOURS, Array, axes, line, line_look
from hil.report.words import column_words
from models.identification.finding import STAGES, Finding, Proposal, Trace
from models.records.record import Record
from models.words.quantities import scale
from models.words.sentences import listed


@dataclass(frozen=True)
class Panel:
    """One quantity of one record: measured and predicted on one abscissa."""

    record: str
    role: str
    quantity: str
    unit: str
    axis: str
    abscissa: Array
    measured: Array
    predicted: dict[str, Array]
    signals: dict[str, Array]

    @property
    def dense(self) -> bool:
        """Whether lines serve better than points."""
        return len(self.measured) > 200 and bool(np.all(np.diff(self.abscissa) >= 0))


def panels(finding: Finding, trace: Trace) -> list[Panel]:
    """A panel for each measured column of a trace; the augmented model only where there is an effect."""
    measured = _columns(trace.measured)
    stages = [stage for stage in STAGES if stage in trace.predicted and (finding.effects or stage != "augmented")]
    predicted = {stage: _columns(trace.predicted[stage]) for stage in stages}
    known = dict[str, Any](record=trace.name, role=trace.role, axis=trace.axis, signals=trace.signals)
    abscissa, drawn = np.asarray(trace.abscissa, dtype=float), list[Panel]()
    for k, (name, unit) in enumerate(map(column_words, finding.columns[: len(measured)])):
        values = {stage: columns[k] for stage, columns in predicted.items()}
        own: dict[str, Any] = {**known, "quantity": name, "unit": unit or finding.unit}
        drawn.append(Panel(**own, abscissa=abscissa, measured=measured[k], predicted=values))
    return drawn


def _columns(values: Array) -> Array:
    """The columns (c, n) of (n,) or (n, c) values."""
    return np.atleast_2d(np.asarray(values, dtype=float).T)


def pooled(drawn: Sequence[Panel]) -> Panel:
    """Panels of one quantity as one, with the stages and signals that all have."""

    def joined(tables: list[dict[str, Array]]) -> dict[str, Array]:
        return {name: np.concatenate([t[name] for t in tables]) for name in tables[0] if all(name in t for t in tables)}

    return replace(
        drawn[0],
        abscissa=np.concatenate([panel.abscissa for panel in drawn]),
        measured=np.concatenate([panel.measured for panel in drawn]),
        predicted=joined([panel.predicted for panel in drawn]),
        signals=joined([panel.signals for panel in drawn]),
    )


def closer(panel: Panel, share: float = 0.06) -> Panel:
    """The stretch of a record where the models before the last one are worst."""
    size = max(int(share * len(panel.measured)), 50)
    rest = np.nan_to_num(panel.measured - panel.predicted.get("calibrated", panel.measured)) ** 2
    start = int(np.argmax(np.convolve(rest, np.ones(size), mode="valid")))
    part = slice(start, start + size)
    predicted = {stage: values[part] for stage, values in panel.predicted.items()}
    signals = {name: values[part] for name, values in panel.signals.items()}
    return replace(
        panel, abscissa=panel.abscissa[part], measured=panel.measured[part], predicted=predicted, signals=signals
    )


def largest(values: Array) -> float:
    """The size of the largest of the finite `values`; 0 without any."""
    return float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))


def binned(signal: Array, values: Array, bins: int = 72) -> tuple[Array, Array]:
    """Mean of `values` over stretches of `signal` with equally many samples, or over each value; NaN in gaps."""
    good = np.isfinite(signal) & np.isfinite(values)
    signal, values = signal[good], values[good]
    levels = np.unique(signal)
    if len(levels) <= bins:
        return levels, np.array([np.mean(values[signal == level]) for level in levels])
    edges = np.unique(np.quantile(signal, np.linspace(0, 1, bins + 1)))
    index = np.clip(np.searchsorted(edges, signal, side="right") - 1, 0, len(edges) - 2)
    order = np.argsort(index, kind="stable")
    ends = np.flatnonzero(np.diff(index[order])) + 1
    centres, means = (np.array([*map(np.mean, np.split(y[order], ends))]) for y in (signal, values))
    gaps = np.flatnonzero(np.diff(centres) > 0.12 * np.ptp(centres)) + 1
    return np.insert(centres, gaps, np.nan), np.insert(means, gaps, np.nan)


def trace_figure(panel: Panel, points: int, residual: bool = True) -> go.Figure:
    """Measured and predicted over the record's abscissa; below, the residuals of the models after the nominal one."""
    factor, unit = scale(map(largest, (panel.measured, *panel.predicted.values())), panel.unit)
    titles = [f"{panel.quantity} in {unit}", f"residual in {unit}"][: 1 + residual]
    name, axis_unit = column_words(panel.axis)
    x = f"{name} in {axis_unit}" if axis_unit else name
    figure = axes(x, titles, 420 if residual else 300, row_heights=[0.68, 0.32][: 1 + residual])
    if panel.dense:
        lines = [(stage, STAGE_COLOURS[stage], values) for stage, values in panel.predicted.items()]
        lines.insert(2, ("measured", INK, panel.measured))
        for name, colour, values in lines:
            line(figure, panel.abscissa, factor * values, name, {"color": colour, "width": 1.2}, points=points)
    else:
        _markers(figure, panel, factor)
    for stage, values in panel.predicted.items() if residual else ():
        if stage != "nominal" or len(panel.predicted) == 1:
            look, rest = {"color": STAGE_COLOURS[stage], "width": 1}, factor * (panel.measured - values)
            shown: dict[str, Any] = {} if panel.dense else {"mode": "markers", "marker": {"size": 7}}
            line(figure, panel.abscissa, rest, f"residual, {stage}", look, 2, points=points, **shown)
    return figure


def motion_figure(proposal: Proposal) -> go.Figure:
    """The waypoints of `proposal`, in mm over s."""
    line = {"color": STAGE_COLOURS["augmented"], "width": 2}
    look: dict[str, Any] = {"mode": "lines+markers", "line": line, "marker": {"size": 5}, "showlegend": False}
    hover = "%{x:.2f} s: %{y:.3f} mm<extra></extra>"
    path = proposal.column if proposal.column.endswith("_m") else "position_m"
    figure = axes("time in s", f"{column_words(path)[0]} in mm", 260)
    return figure.add_scatter(x=proposal.times_s, y=1e3 * proposal.places_m, hovertemplate=hover, **look)


def _markers(figure: go.Figure, panel: Panel, factor: float) -> None:
    symbols = {"nominal": "x-thin", "calibrated": "diamond", "augmented": "circle"}
    order = np.argsort(panel.abscissa, kind="stable")
    here: dict[str, Any] = {"x": panel.abscissa[order], "mode": "markers", "row": 1, "col": 1}
    for stage, values in panel.predicted.items():
        edge = {"color": STAGE_COLOURS[stage], "width": 2 if stage == "nominal" else 0}
        marker = {"color": STAGE_COLOURS[stage], "symbol": symbols[stage], "size": 9, "line": edge}
        figure.add_scatter(y=factor * values[order], name=stage, legendgroup=stage, marker=marker, **here)
    marker = {"color": "white", "size": 9, "line": {"color": INK, "width": 2}}
    figure.add_scatter(y=factor * panel.measured[order], name="measured", legendgroup="measured", marker=marker, **here)


def names(records: Sequence[Record]) -> str:
    return listed(record.name for record in records[:3]) + (" and more" if len(records) > 3 else "")


def columns_figure(records: Sequence[Record]) -> go.Figure:
    """A panel for each column, a line for each record."""
    over = "t_s" if all("t_s" in record.columns for record in records) else next(iter(records[0].columns))
    columns = [name for name in dict.fromkeys(name for r in records for name in r.columns) if name != over]
    height = 120 + 240 * len(columns)
    figure = axes(_title(over), [*map(_title, columns)], height, spacing=0.1 / len(columns))
    figure.update_layout(legend={"y": 1 + 24 / height})
    mode = "lines" if over == "t_s" else "markers"
    for number, record in enumerate(record for record in records if over in record.columns):
        look = line_look(number)
        more = {"mode": mode, "marker": {"color": look["color"]}}
        for row, name in ((r, n) for r, n in enumerate(columns, start=1) if n in record.columns):
            there = np.isfinite(record[name])
            line(figure, record[over][there], record[name][there], record.name, look | {"width": None}, row, **more)
    return figure


def _title(column: str) -> str:
    words, unit = column_words(column)
    return f"{words} in {unit}" if unit else words
