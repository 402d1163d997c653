"""A series' errors as a small drawing: nominal, calibrated and augmented over the noise floor, logarithmically."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from hil.app.campaign.folders.answers import Answer
from hil.app.quantities import number
from hil.app.report.theme import FLOOR, GRID, INK, STAGE_COLOURS

WIDTH, HEIGHT, EDGE = 230, 22, 9
_SHAPES: Final = {
    "nominal": '<rect x="{a:.1f}" y="{b:.1f}" width="9" height="9" fill="white" stroke="{ink}" stroke-width="1.5"/>',
    "calibrated": '<path d="M{x:.1f} {t:.1f} l6 6 l-6 6 l-6 -6 z" fill="{colour}" stroke="{ink}"/>',
    "augmented": '<circle cx="{x:.1f}" cy="{y:.1f}" r="5.5" fill="{colour}" stroke="{ink}"/>',
}
"""Shapes as well as colours: a square, a diamond and a disc."""


@dataclass(frozen=True)
class Axis:
    """From a half to `most` times the noise floor; the same for all series of a page."""

    most: float

    @classmethod
    def of(cls, answers: Sequence[Answer]) -> Axis:
        """Wide enough for every series, to a whole power of ten."""
        shares = [error / a.floor for a in answers if a.floor > 0 for error in a.errors.values() if error > 0]
        return cls(10.0 ** max(1, math.ceil(math.log10(max([s for s in shares if math.isfinite(s)], default=1.0)))))

    def place(self, share: float) -> float:
        """Where a share of the floor stands, px."""
        room = math.log(2 * self.most)
        return EDGE + (WIDTH - 2 * EDGE) * min(max(math.log(2 * share) / room, 0.0), 1.0)


def error_drawing(answer: Answer, axis: Axis) -> str:
    """The drawing of one series; empty where it has no noise floor. The augmented model only where it has an effect."""
    if not answer.floor > 0:
        return ""
    shown = [stage for stage in _SHAPES if stage != "augmented" or answer.effects]
    shares = {stage: answer.errors[stage] / answer.floor for stage in shown if answer.errors[stage] > 0}
    said = ", ".join(f"{stage} {number(share, 3)}" for stage, share in shares.items())
    marks = "".join(_mark(stage, axis.place(share)) for stage, share in shares.items())
    decades = "".join(_line(axis.place(10.0**power), GRID) for power in range(1, 1 + round(math.log10(axis.most))))
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="times the noise'
        f' floor: {said}"><title>times the noise floor: {said}</title>'
        f'<line x1="{EDGE}" x2="{WIDTH - EDGE}" y1="11" y2="11" stroke="{GRID}"/>'
        f"{decades}{_line(axis.place(1.0), FLOOR)}{marks}</svg>"
    )


def legend(axis: Axis) -> str:
    """What the marks are."""
    marks = "".join(
        f'<span><svg width="18" height="{HEIGHT}">{_mark(stage, 9.0)}</svg> {stage}</span>' for stage in _SHAPES
    )
    return (
        f'<p class="legend">Errors on records that no fit has seen, where there are any, over the noise floor (dark'
        f" line; a light line each ten times, up to {number(axis.most)}): {marks}</p>"
    )


def _mark(stage: str, x: float) -> str:
    y = 0.5 * HEIGHT
    return _SHAPES[stage].format(x=x, y=y, a=x - 4.5, b=y - 4.5, t=y - 6, colour=STAGE_COLOURS[stage], ink=INK)


def _line(x: float, colour: str) -> str:
    return f'<line x1="{x:.1f}" x2="{x:.1f}" y1="1" y2="{HEIGHT - 1}" stroke="{colour}" stroke-width="1.5"/>'
