"""The report of a campaign: the distribution of the metric, and the worst cases with the command that repeats each."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from hil.report.builder import page
from hil.report.theme import axes, line_colour, styled, symbol
from hil.report.words import column_words
from models.words.quantities import number, scale

Row = Mapping[str, Any]
WORST: Final = 12  # cases on the page
_NUMBERS: Final = ("median", "p95", "max")
_EACH: Final = 40
"""Runs up to which the spread shows each one."""


def value_of(row: Row, metric: str) -> float:
    """The metric of a run; inf for a run that failed, which is the worst."""
    found = row.get("result", {}).get(metric)
    return float(found) if isinstance(found, int | float) else float("inf")


def groups(rows: Sequence[Row], draws: Sequence[str]) -> dict[str, list[Row]]:
    """Rows by what distinguishes them beside case and draws, in words."""
    parted: dict[str, list[Row]] = {}
    varied = [key for key in _keys(rows, draws) if key not in draws]
    for row in rows:
        words = _point_words({key: row["point"][key] for key in varied if key in row["point"]})
        parted.setdefault(words or "all", []).append(row)
    return parted


def summary_of(rows: Sequence[Row], metric: str) -> dict[str, float]:
    """Runs, failures, unsafe runs, violations of hard limits, and quantiles of the metric."""
    values = np.array([value_of(row, metric) for row in rows])
    good = values[np.isfinite(values)]
    results = [row.get("result", {}) for row in rows]
    found = {"median": np.median(good), "p95": np.quantile(good, 0.95), "max": good.max()} if good.size else {}
    return {
        "runs": len(rows),
        "failed": int(values.size - good.size),
        "unsafe": sum(any(fault["unsafe"] for fault in result.get("faults", [])) for result in results),
        "hard_violations": sum(result.get("hard_violations", 0) for result in results),
        **{name: float(found.get(name, float("nan"))) for name in _NUMBERS},
    }


def worst_of(rows: Sequence[Row], metric: str, count: int = WORST) -> list[Row]:
    """The runs with the largest metric, failed ones first, then those that were unsafe."""

    def badness(row: Row) -> tuple[bool, float, int]:
        unsafe = any(fault["unsafe"] for fault in row.get("result", {}).get("faults", []))
        return unsafe, value_of(row, metric), -row["run"]

    return sorted(rows, key=badness, reverse=True)[:count]


def page_html(name: str, metric: str, rows: Sequence[Row], draws: Sequence[str], repeat: str) -> str:
    """One self-contained page; `repeat` is the command that repeats a run but for its number."""
    parted = groups(rows, draws)
    factor, unit = scale([value_of(row, metric) for row in _finite(rows, metric)], column_words(metric)[1])
    words = column_words(metric)[0]
    label = f"{words} in {unit}" if unit else words
    numeric = [key for key in _keys(rows, draws) if _numeric(rows, key)]
    return page(
        "campaign.html.j2",
        name=name,
        words=words,
        unit=unit,
        factor=factor,
        repeat=repeat,
        count=len(rows),
        groups={group: summary_of(part, metric) for group, part in parted.items()},
        worst=[(row, value_of(row, metric), _point_words(row["point"])) for row in worst_of(rows, metric)],
        spread=_spread(parted, metric, label, factor),
        over=[(key_words(key)[0], _over(parted, metric, key, label, factor)) for key in numeric],
    )


def key_words(key: str) -> tuple[str, str]:
    """Name and unit of a scenario's key."""
    return column_words(key.rpartition(".")[2])


def _keys(rows: Sequence[Row], draws: Sequence[str]) -> list[str]:
    """The drawn keys, then the other keys that differ between runs."""
    others = dict.fromkeys(key for row in rows for key in row["point"] if key != "case" and key not in draws)
    varied = [key for key in others if len({str(row["point"].get(key)) for row in rows}) > 1]
    return [*draws, *varied]


def _numeric(rows: Sequence[Row], key: str) -> bool:
    values = [row["point"].get(key) for row in rows]
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _point_words(point: Mapping[str, Any]) -> str:
    """Keys of the scenario and their values, as `magnet stiffness 24.3 N/m, controller pid friction`."""
    said = []
    for key, value in point.items():
        words, unit = key_words(key)
        said.append(f"{words} {number(value, 4) if isinstance(value, float) else value} {unit}".rstrip())
    return ", ".join(said)


def _finite(rows: Sequence[Row], metric: str) -> list[Row]:
    return [row for row in rows if np.isfinite(value_of(row, metric))]


def _drawn(rows: Sequence[Row], metric: str, factor: float) -> tuple[list[float], list[str]]:
    """The finite values and the names of their runs."""
    good = _finite(rows, metric)
    return [factor * value_of(row, metric) for row in good], [f"run {row['run']}" for row in good]


def _spread(parted: Mapping[str, Sequence[Row]], metric: str, title: str, factor: float) -> go.Figure:
    figure = go.Figure().update_xaxes(title_text=title)
    for k, (name, rows) in enumerate(parted.items()):
        values, runs = _drawn(rows, metric, factor)
        look = {"marker": {"color": line_colour(k), "symbol": symbol(k)}, "showlegend": False}
        shown = "outliers" if len(runs) > _EACH else "all"
        figure.add_box(x=values, name=name.replace(", ", ",<br>"), text=runs, boxpoints=shown, **look)
    return styled(figure, 160 + 60 * len(parted))


def _over(parted: Mapping[str, Sequence[Row]], metric: str, key: str, title: str, factor: float) -> go.Figure:
    figure = axes(" in ".join(filter(None, key_words(key))), title, 420)
    for k, (name, rows) in enumerate(parted.items()):
        values, runs = _drawn(rows, metric, factor)
        marker = {"size": 6, "color": line_colour(k), "symbol": symbol(k), "opacity": 0.7}
        look = {"mode": "markers", "marker": marker, "showlegend": len(parted) > 1}
        x = [row["point"][key] for row in _finite(rows, metric)]
        figure.add_scatter(x=x, y=values, name=name, text=runs, **look)
    return figure
