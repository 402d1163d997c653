"""Sign, size and clock of a capsule that an inner mass shakes, compared with the swings of both masses in air: friction
reduces the swings of the body but keeps their shape.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from models.checks.clocks import drift_line
from models.checks.estimators import Array
from models.checks.finding import Findings
from models.checks.settings import SET
from models.checks.view import View
from models.rigs.tables import MOST_DRIFT


@dataclass(frozen=True)
class Answer:
    """Correlation of the measured position with the body's in air: the strongest one near zero lag with its sign
    (`near`), the largest at any lag (`best`) with that lag in s, and the ratio `size` of the standard deviations.
    """

    near: float
    best: float
    late_s: float
    size: float

    @property
    def turned(self) -> bool:
        """Whether the position moves against the body's."""
        return bool(self.near < -SET.swing_sure and self.best < -self.near + SET.swing_turned)


def check_inner_mass(view: View) -> Findings:
    """Whether a shaken capsule follows its drive in direction, size and time."""
    driven, measured = view.driven, view.measured
    if not view.kind.vibrates or view.rig.drive is None or driven is None:
        return
    if not np.ptp(view.record[driven]) and np.ptp(view.y) > 100 * view.noise:
        yield view.stops("drive_constant", driven, value=float(view.record[driven][0]), travel=np.ptp(view.y))
        return
    both = _swings(view)
    if both is None:
        return
    answer = _answer(*both, _grid_s(view))
    lag = {"lag": abs(answer.late_s), "late": answer.late_s > 0}
    if answer.turned:
        case = "drive_sign.shaken.shifted" if answer.best > SET.swing_sure else "drive_sign.shaken"
        line = view.turned_line(measured)
        yield view.stops(case, beside=driven, correlation=answer.near, line=line, **lag)
    elif answer.best >= SET.alike and not SET.swing_sizes[0] < answer.size < SET.swing_sizes[1]:
        line = view.unit_line(measured)
        yield view.stops("units.shaken", beside=driven, ratio=answer.size, correlation=answer.best, line=line)
    elif drift := _drift(view, both, answer.best):
        line = drift_line(view, drift)
        yield view.weakens("clock_drift.shaken", beside=driven, drift=abs(drift), later=drift > 0, line=line)
    elif answer.best >= max(SET.alike, max(answer.near, 0.0) + SET.ahead) and abs(answer.late_s) > SET.late_s:
        line = f"[clock] offset_s = {answer.late_s:.2g}, offset_std_s = {SET.swing_std_s:g}"
        yield view.notes("clock_offset.shaken", beside=driven, best=answer.best, near=answer.near, line=line, **lag)


def _drift(view: View, both: tuple[Array, Array], best: float) -> float:
    """By how many s the position comes later every second, where this clearly exceeds the `best` without; else 0."""
    step = _grid_s(view)
    (x, y), at = both, np.arange(len(both[0])) * step
    length = float(at[-1])
    share = at / length

    def apart(drifted: float) -> float:
        return 1 - _answer(x, np.interp(at + drifted * share, at, y), step).best

    most = min(SET.lag_most_drifted_s, MOST_DRIFT * length)
    grid = np.arange(-most, most + SET.swing_step_s / 2, SET.swing_step_s)
    near = float(grid[np.argmin([apart(float(drifted)) for drifted in grid])])
    found = scipy.optimize.minimize_scalar(
        apart, bounds=(near - SET.swing_step_s, near + SET.swing_step_s), method="bounded"
    )
    follows = 1 - float(found.fun)
    clear = follows >= SET.swing_follows and follows > best + SET.ahead and abs(found.x) > SET.swing_drifted_s
    return float(found.x) / length if clear else 0.0


def _grid_s(view: View) -> float:
    """The even grid's step in s: no finer than the band needs."""
    return float(max(view.dt, SET.swing_finest_s))


def _swings(view: View) -> tuple[Array, Array] | None:
    """The body's position in air and the measured one, (n,) on an even grid in the vibration's band, if known."""
    force, step = _force(view), _grid_s(view)
    nyquist = 0.5 / step
    if force is None or view.t[-1] - view.t[0] < SET.swing_s or nyquist < 2 * SET.band_hz[0] or not np.ptp(force):
        return None
    grid = np.arange(view.t[0], view.t[-1], step)
    driven, y = (np.interp(grid, view.t, values) for values in (force, view.y))
    x = _in_the_air(view, driven - driven.mean(), grid - grid[0])
    band = scipy.signal.butter(
        2, (SET.band_hz[0], min(SET.band_hz[1], 0.8 * nyquist)), "band", fs=1 / step, output="sos"
    )
    a, b = scipy.signal.sosfiltfilt(band, x), scipy.signal.sosfiltfilt(band, y)
    return (a, b) if np.ptp(a) and np.ptp(b) else None


def _force(view: View) -> Array | None:
    """The force in N on the inner mass that the driven column stands for; None where the rig file does not say."""
    drive, per_unit = view.rig.drive, None
    if drive is None or view.driven is None:
        return None
    if view.driven == "drive_on":
        per_unit = drive.force_N
    elif drive.rated_voltage_V is not None:
        per_unit = drive.force_N / drive.rated_voltage_V
    elif drive.force_constant_N_per_A is not None and drive.coil_resistance_Ohm is not None:
        per_unit = drive.force_constant_N_per_A / drive.coil_resistance_Ohm
    return None if per_unit is None else np.asarray(per_unit * view.record[view.driven])


def _in_the_air(view: View, force: Array, t: Array) -> Array:
    """The body's position in m under `force` in N on the inner mass: `m w' = F - S`, `M v' = S - a F`,
    `S = k r + c r'` (a = 1 where the coil sits on the body), from rest.
    """
    drive, body = view.rig.drive, view.rig.capsule.mass_kg
    assert drive is not None
    m, k = drive.inner_mass_kg, drive.spring_stiffness_N_per_m
    c = max(drive.spring_damping_N_s_per_m, SET.swing_damped * 2 * float(np.sqrt(k * m)))
    a = float(drive.reaction_on_body)
    system = scipy.signal.StateSpace(
        [[0, 1, 0, 0], [-k / m - k / body, -c / m - c / body, 0, 0], [k / body, c / body, 0, 0], [0, 0, 1, 0]],
        [[0], [1 / m + a / body], [-a / body], [0]],
        [[0, 0, 0, 1]],
        [[0]],
    )
    _, position, _ = scipy.signal.lsim(system, force, t)
    return np.asarray(position)


def _answer(x: Array, y: Array, dt: float) -> Answer:
    """Correlations of `y` with `x` moved by up to 0.15 s."""
    most = max(1, round(SET.lag_longest_s / dt))
    inner, among = x[most:-most] - x[most:-most].mean(), len(x) - 2 * most
    sums, squares = (np.cumsum(np.concatenate([[0.0], one])) for one in (y, y**2))
    mean, power = ((one[among:] - one[:-among]) / among for one in (sums, squares))
    deviation = np.sqrt(np.maximum(power - mean**2, 1e-300))
    rows = scipy.signal.correlate(y, inner, "valid", "fft") / (deviation * max(float(np.std(inner)), 1e-300) * among)
    lags, (low, high) = dt * np.arange(-most, most + 1, dtype=np.float64), SET.swing_beside_s
    beside = rows[(lags >= min(low, -1.01 * dt)) & (lags <= high)]
    near, best = float(beside[np.argmax(np.abs(beside))]), int(np.argmax(rows))
    return Answer(near, float(rows[best]), float(lags[best]), float(np.std(y) / np.std(x)))
