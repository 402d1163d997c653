"""The report of a campaign: distribution of the metric, failures, worst cases with the command that repeats each."""

import heapq
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from hil.app.campaign.series_answers import reason_of
from hil.report.builder import page
from hil.report.theme import axes, line_colour, styled, symbol
from hil.report.words import column_words
from models.files.toml import is_number
from models.words.quantities import number, scale

Row = Mapping[str, Any]
WORST: Final = 12  # cases on the page
_NUMBERS: Final = ("median", "p95", "max")
_EACH: Final = 40  # Runs up to which the spread shows each one
_POINTS: Final = 400  # runs of a group that are drawn each; more are drawn as medians and quantiles
_BINS: Final = 24


def value_of(row: Row, metric: str) -> float:
    """The metric of a run; inf for a run that failed, which is the worst."""
    found = row.get("result", {}).get(metric)
    return float(found) if isinstance(found, int | float) else float("inf")


def unsafe(row: Row) -> bool:
    return any(fault["unsafe"] for fault in row.get("result", {}).get("faults", []))


class Runs:
    """The runs of a campaign in columns, whatever their number: `values` of the metric, `unsafe`, `violations`, the
    `drawn` values by key, and the number of the combination `at`; the `worst` rows of those that did not fail, and the
    numbers of those that did by error (`failures`).
    """

    def __init__(self, rows: Iterable[Row], metric: str, draws: Sequence[str] = ()) -> None:
        self.metric, self.failures, self.seconds = metric, dict[str, list[int]](), 0.0
        self.combinations: list[dict[str, Any]] = []
        known, columns = dict[str, int](), list[tuple[float, ...]]()
        worst: list[tuple[tuple[bool, float, int], Row]] = []
        self._words = set[str]()
        for row in rows:
            value, point = value_of(row, metric), row["point"]
            self.seconds += row.get("seconds", 0.0)
            own = {key: v for key, v in point.items() if key != "case" and key not in draws}
            at = known.setdefault(str(own), len(known))
            self.combinations += [own] if at == len(self.combinations) else []
            self._words |= {key for key in draws if not is_number(point.get(key))}
            drawn = (float(v) if is_number(v := point.get(key)) else np.nan for key in draws)
            violations = row.get("result", {}).get("hard_violations", 0)
            columns.append((row["run"], at, value, unsafe(row), violations, *drawn))
            badness = (bool(columns[-1][3]), value, -row["run"])
            error = reason_of(row) or ("" if np.isfinite(value) else f"its result has no number {metric}")
            if not error:
                (heapq.heappush if len(worst) < WORST else heapq.heappushpop)(worst, (badness, row))
            else:
                self.failures.setdefault(error, []).append(row["run"])
        table = np.array(columns, dtype=float).reshape(len(columns), 5 + len(draws))
        self.run, self.at = table[:, 0].astype(int), table[:, 1].astype(int)
        self.values, self.unsafe, self.violations = table[:, 2], table[:, 3], table[:, 4]
        self.drawn = dict(zip(draws, table[:, 5:].T, strict=True))
        self.worst = [row for _, row in sorted(worst, key=lambda one: one[0], reverse=True)]

    def __len__(self) -> int:
        return int(self.values.size)

    @property
    def varied(self) -> list[str]:
        """The keys, beside those drawn, that differ between runs."""
        keys = dict.fromkeys(key for one in self.combinations for key in one)
        return [key for key in keys if len({str(one.get(key)) for one in self.combinations}) > 1]

    def groups(self) -> dict[str, NDArray[np.int_]]:
        """Which runs have the same combination, by what distinguishes it, in words."""
        parted: dict[str, list[int]] = {}
        for k, one in enumerate(self.combinations):
            words = _point_words({key: one[key] for key in self.varied if key in one})
            parted.setdefault(words or "all", []).append(k)
        found = {words: np.flatnonzero(np.isin(self.at, those)) for words, those in parted.items()}
        return dict(sorted(found.items(), key=lambda one: int(self.run[one[1]].min())))

    def summary(self, which: NDArray[np.int_] | slice = slice(None)) -> dict[str, float]:
        """Runs, failures, unsafe runs, violations of hard limits, and quantiles of the metric."""
        values = self.values[which]
        good = values[np.isfinite(values)]
        found = {"median": np.median(good), "p95": np.quantile(good, 0.95), "max": good.max()} if good.size else {}
        return {
            "runs": int(values.size),
            "failed": int(values.size - good.size),
            "unsafe": int(self.unsafe[which].sum()),
            "hard_violations": int(self.violations[which].sum()),
            **{name: float(found.get(name, float("nan"))) for name in _NUMBERS},
        }

    def over(self) -> dict[str, NDArray[np.float64]]:
        drawn = {key: values for key, values in self.drawn.items() if key not in self._words}
        grid = {
            key: np.array([float(one[key]) for one in self.combinations])[self.at]
            for key in self.varied
            if all(is_number(one.get(key)) for one in self.combinations)
        }
        return drawn | grid


def page_html(name: str, runs: Runs, repeat: str, planned: int | None = None, version: str = "") -> str:
    """One self-contained page; `repeat` is the command that repeats a run but for its number. Runs that are still
    missing of those `planned` are told, and the `version` of the program.
    """
    metric, parted = runs.metric, runs.groups()
    factor, unit = scale(runs.values[np.isfinite(runs.values)].tolist(), column_words(metric)[1])
    words = column_words(metric)[0]
    label = f"{words} in {unit}" if unit else words
    return page(
        "campaign.html.j2",
        name=name,
        words=words,
        unit=unit,
        factor=factor,
        repeat=repeat,
        version=version,
        count=len(runs),
        missing=(planned or len(runs)) - len(runs),
        groups={group: runs.summary(which) for group, which in parted.items()},
        summed=any(which.size > _POINTS for which in parted.values()),
        failures=sorted(runs.failures.items(), key=lambda one: -len(one[1])),
        worst=[(row, value_of(row, metric), _point_words(row["point"])) for row in runs.worst],
        spread=_spread(runs, parted, label, factor),
        over=[(key_words(key)[0], _over(runs, parted, key, x, label, factor)) for key, x in runs.over().items()],
    )


def key_words(key: str) -> tuple[str, str]:
    return column_words(key.rpartition(".")[2])


def _point_words(point: Mapping[str, Any]) -> str:
    """Keys of the scenario and their values, as `magnet stiffness 24.3 N/m, controller pid friction`."""
    said = []
    for key, value in point.items():
        words, unit = key_words(key)
        said.append(f"{words} {number(value, 4) if isinstance(value, float) else value} {unit}".rstrip())
    return ", ".join(said)


def _good(runs: Runs, which: NDArray[np.int_]) -> NDArray[np.int_]:
    return np.array(which[np.isfinite(runs.values[which])])


def _names(runs: Runs, which: NDArray[np.int_]) -> list[str]:
    return [f"run {run}" for run in runs.run[which]]


def _spread(runs: Runs, parted: Mapping[str, NDArray[np.int_]], title: str, factor: float) -> go.Figure:
    """A box a group: each run where they are few, else quartiles, whiskers at 5 and 95 %, and the extremes."""
    figure = go.Figure().update_xaxes(title_text=title)
    for k, (name, which) in enumerate(parted.items()):
        good = _good(runs, which)
        x, look = factor * runs.values[good], {"marker": {"color": line_colour(k), "symbol": symbol(k)}}
        named = {"name": name.replace(", ", ",<br>"), "showlegend": False, **look}
        if good.size <= _EACH:
            figure.add_box(x=x, text=_names(runs, good), boxpoints="all", orientation="h", **named)
            continue
        low, q1, middle, q3, high = np.quantile(x, (0.05, 0.25, 0.5, 0.75, 0.95))
        ends = {"lowerfence": [low], "upperfence": [high], "y": [named["name"]], "orientation": "h"}
        figure.add_box(q1=[q1], median=[middle], q3=[q3], **ends, **named)
        extremes = good[np.argsort(x)[[0, *range(-min(WORST, x.size), 0)]]]
        points = {"mode": "markers", "text": _names(runs, extremes), "y": [named["name"]] * extremes.size}
        figure.add_scatter(x=factor * runs.values[extremes], **points, **named)
    return styled(figure, 160 + 60 * len(parted))


def _over(
    runs: Runs, parted: Mapping[str, NDArray[np.int_]], key: str, x: NDArray[np.float64], title: str, factor: float
) -> go.Figure:
    """The metric over a key: each run where they are few, else the median and the 95 % quantile of equal parts."""
    figure = axes(" in ".join(filter(None, key_words(key))), title, 420)
    for k, (name, which) in enumerate(parted.items()):
        good = _good(runs, which)
        look: dict[str, Any] = {"name": name, "legendgroup": name, "showlegend": len(parted) > 1}
        marker = {"size": 6, "color": line_colour(k), "symbol": symbol(k), "opacity": 0.7}
        if good.size <= _POINTS:
            y, text = factor * runs.values[good], _names(runs, good)
            figure.add_scatter(x=x[good], y=y, text=text, mode="markers", marker=marker, **look)
            continue
        parts = np.array_split(good[np.argsort(x[good], kind="stable")], _BINS)
        places = [float(np.mean(x[part])) for part in parts]
        for share, dash, said in ((0.5, "solid", "median"), (0.95, "dot", "95 %")):
            quantiles = [factor * float(np.quantile(runs.values[part], share)) for part in parts]
            shape = {"line": {"color": line_colour(k), "dash": dash}, "mode": "lines+markers", "marker": marker}
            figure.add_scatter(x=places, y=quantiles, text=[said] * _BINS, **shape, **look)
            look["showlegend"] = False
    return figure
