"""Positions that jump, wrap around, go in steps or stand still while the motion goes on."""

import numpy as np
from numpy.typing import NDArray

from models.checks.estimators import Array, grid_step, running_mean, runs_of, white_noise
from models.checks.finding import Findings, RecordFinding
from models.checks.sensor import fresh, silent
from models.checks.settings import SET
from models.checks.view import View

POSITIONS = ("position_m", "carriage_position_m", "angle_rad")
"""Columns that hold a position."""
_NONE = np.zeros(0, dtype=np.int64)
_USUAL = (np.pi, 2 * np.pi, 180.0, 360.0, *(2.0**k for k in range(8, 33)))  # angles and counters that begin again


def jumps(view: View) -> NDArray[np.int64]:
    """Rows (k,) before which the measured position jumps and stays, further than noise or 1 N could move a capsule."""
    if view.measured != "position_m" or view.kind.stage:
        return _NONE
    interval = view.dt / float(np.mean(fresh(view)))
    least = max(SET.jump_noises * view.noise, SET.jump_force_N / view.rig.capsule.mass_kg * interval**2)
    rows = _within(view, np.array([row for row, _ in _steps(view.y, least)], dtype=np.int64))
    return rows[~silent(view)[rows - 2]]  # where a sensor comes back, its position differs


def slips(view: View, name: str) -> list[tuple[int, int]]:
    """First and last rows before which a place `name` of a machine jumps and stays, unless a lost signal held it."""
    return [(first, last) for first, last in _leaps(view, name) if not _held(view.record[name], first)]


def _leaps(view: View, name: str) -> list[tuple[int, int]]:
    size = np.abs(np.diff(view.record[name]))
    if name not in POSITIONS or not len(size) or not size.any() or len(wraps(view.record[name])):
        return []
    usual = float(
        np.quantile(size, 1 - SET.jump_most * SET.jump_long / max(len(size), SET.jump_most * SET.jump_long + 1))
    )
    least = max(SET.jump_far * usual, SET.jump_noises * white_noise(view.record[name]))
    found = _steps(view.record[name], least, SET.jump_long)
    return [one for one in found if len(_within(view, np.arange(one[0], one[1] + 1))) == one[1] + 1 - one[0]]


def _held(values: Array, row: int) -> bool:
    """Whether `values`, which seldom repeat, repeat until the `row`."""
    same = np.diff(values) == 0
    return bool(same[row - SET.beside : row - 1].all() and np.mean(same) < SET.coarse_equal)


def _within(view: View, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """The `rows` that follow the one before without a gap in time."""
    return np.asarray(rows[np.diff(view.t)[rows - 1] < SET.stamps_near * view.dt])


def _steps(values: Array, least: float, longest: int = 1) -> list[tuple[int, int]]:
    """First and last of up to `longest` rows before which `values` step by more than `least`, alone, and stay there."""
    n, size, found = SET.beside, np.abs(np.diff(values, append=values[-1])), list[tuple[int, int]]()
    if len(values) < 4 * n:
        return []
    runs = [(a, b) for a, b in runs_of(size > least) if b - a <= longest and n < a + 2 and b <= len(values) - n]
    for a, b in runs if len(runs) <= SET.beside * SET.jump_most else ():
        step = abs(float(values[b] - values[a]))
        stays = abs(float(np.median(values[b : b + n]) - np.median(values[a + 1 - n : a + 1])))
        if max(size[a - 1], size[b]) * (b - a) < SET.jump_alone * step and stays > SET.jump_stays * step:
            found.append((a + 1, b))
    return found if len(found) <= SET.jump_most else []


def check_jumps(view: View) -> Findings:
    """A position that jumps: a measured one faster than anything moves it, a machine's far beyond its usual steps."""
    machine = view.moving_column if view.kind.stage else view.driven
    if len(rows := jumps(view)):
        yield _jumped(view, view.measured, "place_jumps", [(row, row) for row in rows.tolist()])
    if machine and (found := slips(view, machine)):
        yield _jumped(view, machine, f"place_jumps.{'stage' if view.kind.stage else 'driven'}", found)
    if machine and machine != view.measured and (lost := [one for one in _leaps(view, machine) if one not in found]):
        yield _jumped(view, machine, "place_jumps.held", lost)


def _jumped(view: View, name: str, case: str, found: list[tuple[int, int]]) -> RecordFinding:
    values, rows = view.record[name], [first for first, _ in found]
    largest = view.length(max(abs(float(values[last] - values[first - 1])) for first, last in found))
    return view.finding("weakens", case, name, rows, n=len(rows), largest=largest, force=SET.jump_force_N)


def without_slips(view: View, name: str) -> tuple[Array, int]:
    """The place `name` (n,) without its jumps, and their number."""
    values, found = view.record[name], slips(view, name)
    steps, size = np.zeros(len(values)), np.diff(values, prepend=values[0])
    for first, last in found:
        steps[first : last + 1] = size[first : last + 1]
    return values - np.cumsum(steps), len(found)


def check_wraps(view: View) -> Findings:
    """Positions, measured or driven, that wrap around: an angle from 180 to -180 degrees, a counter that overflows."""
    for name in POSITIONS:
        if name not in (view.moving_column, view.driven, view.measured):
            continue
        values = view.record[name]
        rows = wraps(values)
        if len(rows):
            jump = np.diff(values)[rows - 1]
            per_sample = (values[rows - 1] - values[rows - SET.side]) / (SET.side - 1)
            after = float(np.mean(np.abs(jump - per_sample))) / abs(view.rig.columns.entry(name).factor())
            usual = min(_USUAL, key=lambda size: abs(np.log(size / after)))
            after = usual if abs(usual / after - 1) < SET.wrap_snapped else after
            largest, line = (
                view.length(float(np.max(np.abs(jump)))),
                view.columns_line(name, wrap=float(f"{after:.12g}")),
            )
            yield view.stops("place_wraps", name, rows, n=len(rows), largest=largest, share=SET.wrap_jump, line=line)


def wraps(values: Array) -> NDArray[np.int64]:
    """Rows (k,) before which `values` (n,) jump back through most of their span while they go on as before; none where
    a jump is of another kind, like the step of a command. Flicker at one passage counts once.
    """
    side, few = SET.side, SET.few
    rows = np.flatnonzero(np.abs(np.diff(values)) > SET.wrap_jump * np.ptp(values)) + 1
    if not len(rows) or len(rows) > SET.wrap_most * len(values):
        return _NONE
    passages = np.split(rows, np.flatnonzero(np.diff(rows) > side) + 1)
    sure, sudden = 3 * white_noise(values), []
    for first, last in ((p[0], p[-1]) for p in passages if len(p) % 2 and p[0] > side and p[-1] < len(values) - side):
        ends = ((first - side, first - few), (last, last + side - few))
        before, after = (np.median(values[b : b + few]) - np.median(values[a : a + few]) for a, b in ends)
        back = -np.sign(values[last] - values[first - 1])
        if min(back * before, back * after) < -sure:
            return _NONE
        sudden += [first] if min(back * before, back * after) > sure else []
    return np.array(sudden, dtype=np.int64)


def _half_step(view: View, x: Array) -> int:
    """Half the samples that a step of the position `x` lasts at the usual speed; 0 where it has no such steps."""
    step = grid_step(x)
    speed = float(np.median(np.abs(view.speed[view.moves]))) if view.moves.any() else 0.0
    if step == 0 or speed == 0 or step <= SET.step_wide * speed * view.dt:
        return 0
    return int(max(1, round(0.5 * min(step / speed, SET.step_longest_s) / view.dt)))


def without_steps(view: View, x: Array) -> Array:
    """The position `x` (n,) without the steps of a coarse scale, if any: its running mean over one step."""
    half = _half_step(view, x)
    return running_mean(x, half) if half else x


def check_driven_resolution(view: View) -> Findings:
    """A driven position that goes in steps."""
    name = view.driven
    if name in POSITIONS and (half := _half_step(view, view.record[name])):
        step, length = view.length(grid_step(view.record[name])), 2 * half * view.dt
        if view.kind.drawn:
            yield view.weakens("driven_resolution.pull", name, step=step, length=length)
        else:
            yield view.notes("driven_resolution", name, step=step, length=length)


def check_stuck(view: View) -> Findings:
    """Whether the measured column swings through zero while the driven position rests, as far as in motion: an encoder
    that is stuck or slips. At a reversal dry friction holds an axis while its force goes once from one break-away to
    the other; for an axis it must therefore come back, too.
    """
    name = view.driven
    if name not in POSITIONS or name != view.moving_column or not view.moves.any():
        return
    y, least_swings = view.averaged(view.y, 0.5 * SET.mean_s), 2 if view.kind.stage else 1
    whole = float(np.diff(np.percentile(y[view.moves], [5, 95]))[0])
    settled, least = round(SET.stuck_settled_s / view.dt), round((SET.stuck_settled_s + SET.stuck_s) / view.dt)
    rests = [(a + settled, b) for a, b in runs_of(~view.moves, least)]
    beyond = [y[a:b][np.abs(y[a:b]) > 0.5 * SET.stuck_much * whole] for a, b in rests]
    swings = [np.count_nonzero(np.diff(np.sign(there))) for there in beyond]
    stuck = [rest for rest, n in zip(rests, swings, strict=True) if n >= least_swings]
    if stuck and whole >= 20 * view.noise:
        begins, longest = [a for a, _ in stuck], max(b - a for a, b in stuck) * view.dt
        yield view.weakens("driven_stuck", name, begins, longest=longest, n=least_swings, share=SET.stuck_much)
