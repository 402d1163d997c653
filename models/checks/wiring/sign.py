"""Signs: a force that drives the motion which it should resist, a capsule that goes against its drive."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.information.excitation import check_information
from models.checks.settings import SET
from models.checks.view import Array, View, running_mean, white_noise
from models.files.units import unit_of


def _turned(view: View, column: str) -> str:
    return f"{view.turned_line(column)}, or change the wire over"


def check_force_sign(view: View) -> list[RecordFinding]:
    """Whether the force of a pull, a stage or a coil goes with the motion, as one that overcomes friction does."""
    if not (view.kind.imposed or view.kind.pushed) or not view.timed or view.measured not in view.record.columns:
        return []
    if view.kind.stage:
        column, told = view.measured, _stage(view)
    elif view.pushing is not None:
        column, told = view.pushing[0], _stroke(view, view.pushing[1])
    else:
        return []
    if not told:
        return _unsigned(view, column)
    driving = column.removesuffix(unit_of(column)).strip("_").replace("_", " ")
    return [
        view.finding(
            "force_sign",
            "stops",
            f"{column} against {view.moving_column}, throughout",
            f"{column} opposes the motion that it should drive: friction would give energy; the sign of the"
            f" {driving} (or of the {view.moving_column.partition('_')[0]}) is turned round",
            told,
            _turned(view, column),
        )
    ]


def _stroke(view: View, force: Array) -> str:
    """A stroke's `force` in N towards its end, where friction has built up, times its direction."""
    ends = np.array([d * float(np.mean(force[(a + b) // 2 : b])) for a, b, d in view.strokes])
    if not len(ends):
        return ""
    directions = {d for _, _, d in view.strokes}
    if len(directions) == 1 and len(ends) < 2:
        a, b, d = view.strokes[0]
        ends = np.array([d * float(np.mean(piece)) for piece in np.array_split(force[(a + b) // 2 : b], 8)])
    error = max(float(np.std(ends)) / np.sqrt(len(ends)), 3 * white_noise(force) / np.sqrt(len(force)), 1e-15)
    mean = float(np.mean(ends))
    if mean < -SET.sure * error and mean < -SET.sign_mean * float(np.percentile(np.abs(force), 90)):
        return f"force times direction is {mean:.3g} N on average over {len(ends)} strokes; friction makes it positive"
    return ""


def _unsigned(view: View, column: str) -> list[RecordFinding]:
    """Whether a pull's force turns round with the motion, as friction does: what it is in one direction less what it is
    in the other, against how much it varies.
    """
    ways = [[float(np.mean(view.y[(a + b) // 2 : b])) for a, b, d in view.strokes if d == way] for way in (1.0, -1.0)]
    if not view.kind.drawn or min(map(len, ways)) < SET.sign_strokes or check_information(view):
        return []
    forward, backward = map(np.array, ways)
    turns = float(np.mean(forward) - np.mean(backward)) / 2
    error = float(np.hypot(np.std(forward) / np.sqrt(len(forward)), np.std(backward) / np.sqrt(len(backward)))) / 2
    size = float(np.percentile(np.abs(view.y), 90))
    if size < 20 * view.noise or abs(turns) + SET.sure / 2 * error > SET.sign_turns * size:
        return []
    return [
        view.finding(
            "force_unsigned",
            "stops",
            f"{column} against {view.moving_column}, throughout",
            f"{column} does not turn round with the motion, as friction does: its sign (or that of"
            f" {view.moving_column}) was not logged, or the two do not belong together",
            f"{np.mean(forward):.3g} N forward and {np.mean(backward):.3g} N backward, in {len(forward)} and"
            f" {len(backward)} strokes",
            "log both with their signs",
        )
    ]


def _stage(view: View) -> str:
    """Signs of mass and of friction in a line through the force."""
    x, force, n = view.record[view.moving_column], view.y, max(1, round(0.02 / view.dt))
    v = np.gradient(running_mean(x, n)) / view.dt
    a = np.gradient(running_mean(v, n)) / view.dt
    place = [np.sin(x), np.cos(x)] if view.turns else []
    rows = np.column_stack([a, np.sign(v) * view.moves, v, np.ones(len(x)), x, *place])
    scale = np.maximum(np.std(rows, axis=0), 1e-300)
    scale[3] = 1.0
    weights, *_ = np.linalg.lstsq(rows / scale, force, rcond=None)
    work = float(np.sum(force * v)) * view.dt
    lost = float(np.sum(np.abs(force * v))) * view.dt
    if (
        work < -SET.sign_work * lost
        and weights[1] < 0
        and (weights[0] < 0 or abs(weights[0]) < SET.sign_weight * abs(weights[1]))
    ):
        return "mass and friction both come out negative, and the work of the force over the record is negative"
    return ""


def check_drive_sign(view: View) -> list[RecordFinding]:
    """Whether the capsule goes where a magnet takes it."""
    if not view.kind.follows or not view.timed or view.driven is None or view.measured not in view.record.columns:
        return []
    n = max(1, round(0.1 / view.dt))
    x, c = running_mean(view.y, n), running_mean(view.record[view.driven], n)
    if not np.ptp(x) or not np.ptp(c) or np.ptp(x) < 20 * view.noise:
        return []
    slope = _slope(c, x)
    correlation = slope * float(np.std(c)) / float(np.std(x))
    if correlation > SET.sign_against or np.ptp(x) < SET.sign_follows * np.ptp(c):
        return []
    return [
        view.finding(
            "drive_sign",
            "stops",
            f"{view.measured} against {view.driven}, throughout",
            f"{view.measured} goes back where {view.driven} goes forward: one of the two has its sign turned round",
            f"correlation {correlation:.2f} between the two places",
            _turned(view, view.measured),
        )
    ]


def _slope(x: Array, y: Array) -> float:
    return float(np.cov(x, y)[0, 1] / np.var(x))
