"""Figure of the residual against whatever it may depend on, before and after."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from hil.report.panels import Panel, binned, pooled
from hil.report.theme import STAGE_COLOURS, Array, line_colour, styled
from hil.report.words import column_words
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
    figure = make_subplots(
        rows=len(names),
        cols=2,
        shared_yaxes=True,
        horizontal_spacing=0.03,
        vertical_spacing=58 / (60 + 225 * len(names)),
        column_titles=[f"before: {before} model", f"after: {after} model"],
    )
    for row, name in enumerate(names, start=1):
        words, own = column_words(name)
        along, prefixed = scale(np.concatenate([pool.signals[name] for pool in pools]), own)
        for column, stage in enumerate((before, after), start=1):
            here = {"row": row, "col": column}
            for number, (pool, rest) in enumerate(zip(pools, rests[stage], strict=True)):
                colour = line_colour(number) if several else STAGE_COLOURS[stage]
                _cloud(figure, along * pool.signals[name], factor * rest, colour, pool.quantity, **here)
                for k, (way, dash) in enumerate(_ways(pool, name)):
                    centres, means = binned(along * pool.signals[name][way], factor * rest[way])
                    look: dict[str, Any] = {"line": {"color": colour, "width": 2, "dash": dash}, "marker": {"size": 4}}
                    look |= {"name": pool.quantity, "showlegend": several and (row, column, k) == (1, 1, 0)}
                    figure.add_scatter(x=centres, y=means, mode="lines+markers", **look, **here)
            figure.update_xaxes(title=f"{words} in {prefixed}" if prefixed else words, **here)
        figure.update_yaxes(title=f"residual in {unit}", row=row, col=1)
    limit = 1.15 * factor * float(np.nanquantile(everything, 0.995))
    figure.update_yaxes(range=[-limit, limit])
    return styled(figure, 60 + 225 * len(names), legend={"orientation": "h", "x": 0, "y": 1.05, "yanchor": "bottom"})


def _cloud(figure: go.Figure, signal: Array, rest: Array, colour: str, name: str, **here: int) -> None:
    good = np.flatnonzero(np.isfinite(signal) & np.isfinite(rest))
    if not len(good):
        return
    if len(good) > MOST_POINTS:
        good = np.sort(np.random.default_rng(0).choice(good, MOST_POINTS, replace=False))
    marker = {"color": colour, "size": 4 if len(good) > 100 else 7, "opacity": 0.28 if len(good) > 100 else 0.6}
    points = {"x": signal[good].astype(np.float32), "y": rest[good].astype(np.float32), "marker": marker}
    figure.add_scatter(**points, mode="markers", name=name, showlegend=False, hoverinfo="skip", **here)


def _ways(pool: Panel, name: str) -> list[tuple[NDArray[np.bool_], str]]:
    """The samples that share a local mean, with the line's dash: forward and backward motion apart where the record
    tells.
    """
    all_of_them = [(np.ones(len(pool.measured), dtype=bool), "solid")]
    if SPEED not in pool.signals or name in (SPEED, "t_s"):
        return all_of_them
    speed = pool.signals[SPEED]
    least = 0.02 * float(np.nanmax(np.abs(speed)))
    ways = ((speed > least, "solid"), (speed < -least, "dot"))
    return [(way, dash) for way, dash in ways if np.count_nonzero(way) > 50] or all_of_them
