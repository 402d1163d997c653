"""A record that begins in the middle of a motion, or where an earlier one left the wall stretched."""

import numpy as np

from models.checks.finding import Findings
from models.checks.settings import SET
from models.checks.view import View


def run_in(view: View) -> int:
    """How many rows of a record do not count that starts in motion, or under the load of an earlier one; 0 for one that
    starts at rest and free.
    """
    if view.kind.stage or view.kind.vibrates or not view.moves.any():
        return 0
    if not (_starts_in_motion(view) or _starts_loaded(view)):
        return 0
    travelled = np.cumsum(np.abs(view.speed) * view.dt)
    way = SET.wall_settled_m if view.kind.drawn else SET.settled_m
    return min(int(np.searchsorted(travelled, way)), round(SET.start_share * len(travelled)))


def _first(view: View, seconds: float = SET.start_s) -> slice:
    return slice(0, max(2, round(seconds / view.dt)))


def _starts_in_motion(view: View) -> bool:
    """Whether the motion is on at once: at half the usual speed and more, or, of a pull, whose driven place has no
    noise and no way to gain speed, at any.
    """
    first, usual = _first(view), float(np.median(np.abs(view.speed[view.moves])))
    least = 0.0 if view.kind.drawn else 0.5 * usual
    return bool(view.moves[first].all()) and abs(float(np.mean(view.speed[first]))) >= least


def _starts_loaded(view: View) -> bool:
    """Whether the magnet's gap is at the start much of what it is in motion; seen from the middle between both ways,
    where there are two, so that a zero that is elsewhere is no load. The force of a pull tells none: the resistance
    that it has in motion holds at rest, too.
    """
    if not view.kind.follows or not {"carriage_position_m", "position_m"} <= set(view.record.columns):
        return False
    load = view.record["carriage_position_m"] - view.record["position_m"]
    low, high = np.percentile(load[view.moves], [10, 90])
    forth = float(np.mean(view.speed[view.moves] > 0))
    middle, most = 0.0, max(abs(low), abs(high))
    if SET.both_ways < forth < 1 - SET.both_ways:
        middle, most = 0.5 * (low + high), 0.5 * (high - low)
    return bool(abs(float(np.mean(load[_first(view, SET.at_once_s)])) - middle) > SET.loaded * most > 0)


def check_start(view: View) -> Findings:
    """Whether the motion is on when the record starts, or a load of an earlier one; predictions start at rest and
    free.
    """
    if rows := run_in(view):
        speed, moving = float(np.mean(view.speed[_first(view)])), _starts_in_motion(view)
        begins = f"in motion at {1e3 * speed:.3g} mm/s" if moving else "under the load that an earlier motion left"
        yield view.notes(
            "starts_in_motion",
            f"the record starts {begins}; predictions start at rest and free, so its first {rows * view.dt:.3g} s count"
            " in no fit and no error",
            "speed over the first tenth of a second" if moving else "gap of the magnet at once, beside in motion",
            "record from half a second before the motion starts, with the capsule free",
            view.moving_column,
            [0],
        )
