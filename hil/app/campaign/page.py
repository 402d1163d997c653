"""The report of a campaign: how the metric is distributed, and its worst cases with the command that repeats each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from hil.app.report.page import STYLE
from hil.app.report.theme import figure_html, styled

Row = Mapping[str, Any]
WORST: Final = 12
_NUMBERS: Final = ("median", "p95", "max")
_MILLI: Final = {"_m": "mm", "_N": "mN", "_m_s": "mm/s"}


def value_of(row: Row, metric: str) -> float:
    """The metric of a run; inf where it has none, for a run that failed is the worst."""
    found = row.get("result", {}).get(metric)
    return float(found) if isinstance(found, int | float) else float("inf")


def groups(rows: Sequence[Row], draws: Sequence[str]) -> dict[str, list[Row]]:
    """Rows by what sets them apart beside case and draws."""
    parted: dict[str, list[Row]] = {}
    for row in rows:
        words = [
            f"{key.rpartition('.')[2]} {value}"
            for key, value in row["point"].items()
            if key != "case" and key not in draws
        ]
        parted.setdefault(", ".join(words) or "all", []).append(row)
    return parted


def summary_of(rows: Sequence[Row], metric: str) -> dict[str, float]:
    """Runs, failures, unsafe ones, violations of hard limits, and the metric's quantiles over the runs that have
    one.
    """
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
    unit, scale = _unit(metric)
    words = _words(metric)
    label = f"{words}, {unit}" if unit else words
    figures = [("How it is spread", _spread(parted, metric, label, scale))]
    figures += [(f"Over {key}", _over(parted, metric, key, label, scale)) for key in draws if _numeric(rows, key)]
    body = _summary_table(parted, metric, unit, scale) + _worst_table(rows, metric, unit, scale, repeat)
    body += "".join(
        f'<section><h2>{escape(title)}</h2><div class="figure">{figure_html(figure, f"figure-{k}")}</div></section>'
        for k, (title, figure) in enumerate(figures)
    )
    title = f"{name}: {words} over {len(rows)} runs"
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE.read_text(encoding='utf-8')}</style><script>{get_plotlyjs()}</script></head>"
        "<body><main><header><p"
        f' class="eyebrow">Campaign</p><h1>{escape(title)}</h1></header>{body}</main></body></html>\n'
    )


def _ending(metric: str) -> str:
    return next((end for end in sorted(_MILLI, key=len, reverse=True) if metric.endswith(end)), "")


def _words(metric: str) -> str:
    return metric.removesuffix(_ending(metric)).replace("_", " ")


def _unit(metric: str) -> tuple[str, float]:
    ending = _ending(metric)
    return (_MILLI[ending], 1e3) if ending else ("", 1.0)


def _numeric(rows: Sequence[Row], key: str) -> bool:
    return all(isinstance(row["point"].get(key), int | float) for row in rows)


def _summary_table(parted: Mapping[str, Sequence[Row]], metric: str, unit: str, scale: float) -> str:
    lines = []
    for name, rows in parted.items():
        s = summary_of(rows, metric)
        numbers = [f"{scale * s[key]:.3f}" for key in _NUMBERS]
        lines.append([name, *(str(s[key]) for key in ("runs", "failed", "unsafe", "hard_violations")), *numbers])
    heads = ("", "runs", "failed", "unsafe", "violations", *(f"{name} {unit}" for name in _NUMBERS))
    return _table("Numbers", heads, lines)


def _worst_table(rows: Sequence[Row], metric: str, unit: str, scale: float, repeat: str) -> str:
    lines = []
    for row in worst_of(rows, metric):
        point = ", ".join(f"{key} {_short(value)}" for key, value in row["point"].items())
        lines.append(
            [row.get("error") or f"{scale * value_of(row, metric):.3f}", point, f"{repeat} --run {row['run']}"]
        )
    return _table("Worst cases", (f"{metric} {unit}", "case", "repeat it with"), lines)


def _short(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _table(title: str, heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(h)}</th>" for h in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in line) + "</tr>" for line in lines)
    return f"<section><h2>{title}</h2><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></section>"


def _finite(rows: Sequence[Row], metric: str) -> list[Row]:
    return [row for row in rows if np.isfinite(value_of(row, metric))]


def _spread(parted: Mapping[str, Sequence[Row]], metric: str, title: str, scale: float) -> go.Figure:
    figure = go.Figure()
    for name, rows in parted.items():
        good = _finite(rows, metric)
        figure.add_trace(
            go.Box(
                x=[scale * value_of(row, metric) for row in good],
                name=name,
                boxpoints="outliers",
                text=[f"run {row['run']}" for row in good],
                showlegend=False,
            )
        )
    figure.update_xaxes(title_text=title)
    return styled(figure, 160 + 60 * len(parted))


def _over(parted: Mapping[str, Sequence[Row]], metric: str, key: str, title: str, scale: float) -> go.Figure:
    figure = go.Figure()
    for name, rows in parted.items():
        good = _finite(rows, metric)
        figure.add_trace(
            go.Scattergl(
                x=[row["point"][key] for row in good],
                y=[scale * value_of(row, metric) for row in good],
                name=name,
                mode="markers",
                text=[f"run {row['run']}" for row in good],
                marker={"size": 5},
            )
        )
    figure.update_xaxes(title_text=key)
    figure.update_yaxes(title_text=title)
    return styled(figure, 420)
