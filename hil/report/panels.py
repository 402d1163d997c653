"""What a figure draws of a record: one panel a measured quantity, thinned so that every slip event stays visible."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.report.words import column_words
from models.identification.finding import STAGES, Finding, Trace

Array = NDArray[np.float64]


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
