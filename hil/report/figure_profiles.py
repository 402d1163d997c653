"""The profile likelihoods of the fitted parameters, as small multiples: a flat one is seen at a glance."""

from collections.abc import Sequence
from textwrap import wrap

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.report.theme import FLOOR, MUTED, STAGE_COLOURS, styled
from hil.report.words import parameter_words
from models.effects import effect_words
from models.identification.finding import Profile
from models.identification.fitting.profile import LINE
from models.words.quantities import scale, unit_words

COLUMNS, HIGHEST = 3, 3.0  # panels side by side; times the 95 % line that is drawn
_WIDEST = 28  # characters of a title


def profile_figure(profiles: Sequence[Profile]) -> go.Figure | None:
    """A panel a parameter: the drop of the log-likelihood over its value, the 95 % line, and where it was fitted."""
    if not profiles:
        return None
    rows = -(-len(profiles) // COLUMNS)
    height = 60 + 240 * rows
    figure = make_subplots(
        rows=rows,
        cols=COLUMNS,
        horizontal_spacing=0.07,
        vertical_spacing=124 / height if rows > 1 else 0.0,
        subplot_titles=[_title(one) for one in profiles],
        shared_yaxes=True,
    )
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
