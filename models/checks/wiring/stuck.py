"""A driven place that rests while what is measured goes on as in motion: an encoder that is stuck or slips."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.instrument.resolution import PLACES
from models.checks.settings import SET
from models.checks.view import Array, View, running_mean, runs_of


def check_stuck(view: View) -> list[RecordFinding]:
    """Whether the measured column ranges as far at rest as in motion, through zero. Dry friction holds an axis at rest
    while its force goes from one break-away to the other, once a turning point: there it must come back, too.
    """
    if not view.timed or view.driven not in PLACES or view.driven != view.moving_column or not view.moves.any():
        return []
    y = running_mean(view.y, max(1, round(0.5 * SET.mean_s / view.dt)))
    whole = float(np.diff(np.percentile(y[view.moves], [5, 95]))[0])
    settled, least = round(SET.stuck_settled_s / view.dt), round((SET.stuck_settled_s + SET.stuck_s) / view.dt)
    rests = [(a + settled, b) for a, b in runs_of(~view.moves) if b - a >= least]
    least_swings = 2 if view.kind.stage else 1
    stuck = [(a, b) for a, b in rests if _swings(y[a:b], 0.5 * SET.stuck_much * whole) >= least_swings]
    if not stuck or whole < 20 * view.noise:
        return []
    return [
        view.finding(
            "driven_stuck",
            "weakens",
            f"{view.driven}, {view.at([a for a, _ in stuck])}",
            f"{view.driven} rests for up to {max(b - a for a, b in stuck) * view.dt:.3g} s while {view.measured}"
            " goes to and fro as in motion: its encoder is stuck, slips or was not logged",
            f"{least_swings} or more swings at rest through more than {SET.stuck_much:.0%} of the range in motion",
            "look at the encoder and its coupling; leave these stretches out of the record",
        )
    ]


def _swings(y: Array, level: float) -> int:
    """How often `y` goes from beyond `level` on one side of 0 to beyond it on the other."""
    sides = np.sign(y[np.abs(y) > level])
    return int(np.count_nonzero(np.diff(sides)))
