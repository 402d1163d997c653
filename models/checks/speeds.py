"""Columns that repeat others, as a logged speed does: lag, gain and sign; and what force a motion explains."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.checks.estimators import Array, Mask, regressed, running_mean, smooth_speed, white_noise
from models.checks.finding import Findings
from models.checks.settings import SET
from models.checks.view import View
from models.files.units import factor, split_unit, unit_of
from models.records.found_columns import commanded


@dataclass(frozen=True)
class Agreement:
    """A column as `gain` times another, `lag_s` later, and the share of it that is neither."""

    gain: float
    lag_s: float
    left: float

    @property
    def close(self) -> bool:
        """Whether it may stand for the place's."""
        off = (abs(self.gain - 1), abs(self.lag_s), self.left)
        return all(np.less(off, (SET.speed_gain, SET.speed_lag_s, SET.speed_left)))


def agreement(place: Array, logged: Array, dt: float) -> Agreement | None:
    """How a `logged` speed (n,) belongs to the `place` (n,), both smoothed alike; None where nothing moves."""
    speed, noise, n = smooth_speed(place, dt)
    if float(np.std(speed)) <= 2 * noise:
        return None
    return _agreement(speed, logged, n, dt)


def _agreement(smooth: Array, logged: Array, n: int, dt: float) -> Agreement | None:
    """How a `logged` column (n,) belongs to another that is `smooth`, the running mean of a running mean over `n`."""
    inner = slice(3 * n, len(smooth) - 3 * n)
    alike = running_mean(running_mean(logged, n), n)[inner]
    rows = np.column_stack([smooth, np.gradient(smooth, dt), np.ones(len(smooth))])[inner]
    if len(rows) < SET.side or not np.std(alike):
        return None
    gain, late, _ = found = regressed(rows, alike)
    left = float(np.std(alike - rows @ found) / np.std(alike))
    return Agreement(float(gain), float(-late / gain) if gain else 0.0, left)


def check_logged_speed(view: View) -> Findings:
    """A logged speed that has another sign, size or delay than the place's: the place's is used instead."""
    name = next((one for one in view.record.layout.optional if one.startswith("velocity")), "")
    if not view.kind.stage or name not in view.record.columns:
        return
    found = agreement(view.record[view.moving_column], view.record[name], view.dt)
    if found is None or found.close:
        return
    values: dict[str, Any] = {"gain": found.gain, "lag": abs(found.lag_s), "late": found.lag_s > 0, "left": found.left}
    values |= {"beside": view.moving_column, "place": view.moving_column}
    size = min((10.0**k for k in range(-3, 4)), key=lambda size: abs(np.log(size * abs(found.gain) or 1e-300)))
    if found.gain < 0:
        yield view.notes("speed_apart.sign", name, line=view.turned_line(name), **values)
    elif size != 1 and abs(size * found.gain - 1) < SET.speed_gain:
        yield view.notes("speed_apart.size", name, line=view.columns_line(name, scale=size), **values)
    else:
        yield view.notes("speed_apart", name, **values)


def check_repeated(view: View) -> Findings:
    """Further columns that hold a place, its speed or acceleration, or a force once more, in another size or late."""
    record, place = view.record, view.moving_column
    speed, _, n = smooth_speed(record[place], view.dt)
    shown = dict.fromkeys(name for name in (place, view.driven, view.measured) if name)
    ours = [(name, unit_of(name), running_mean(running_mean(record[name], n), n)) for name in shown]
    ours += [(f"the speed of {place}", f"{unit_of(place)}/s", speed)]
    ours += [(f"the acceleration of {place}", f"{unit_of(place)}/s2", np.gradient(speed, view.dt))]
    for name in (name for name in record.columns if name not in view.kind.known and not commanded(name)):
        stated, values = split_unit(name)[1], record[name]
        alike = [(other, size, smooth) for other, unit, smooth in ours if stated and (size := factor(stated, unit))]
        if not alike or not np.isfinite(values).all():
            continue
        fits = [(fit, other) for other, size, y in alike if (fit := _agreement(y, size * values, n, view.dt))]
        fit, other = min(fits, key=lambda one: one[0].left, default=(None, ""))
        if fit is None or fit.left > SET.speed_left:
            continue
        lag = round(abs(fit.lag_s), 6)
        said: dict[str, Any] = {"gain": fit.gain, "lag": lag, "late": fit.lag_s > 0, "other": other}
        finer = (
            fit.close
            and other in record.columns
            and white_noise(record[other])
            > SET.repeated_finer * white_noise(values * (factor(stated, unit_of(other)) or 0.0) / fit.gain)
        )
        if finer:
            line = view.columns_line(other, column=name, unit=stated)
            yield view.notes("column_repeated.finer", name, beside=other, line=line, **said)
        elif not fit.close:
            yield view.notes("column_repeated", name, beside=other, **said)


def motion_rows(view: View, seconds: float = SET.motion_windows_s[0]) -> Array:
    """Acceleration, direction, speed, 1, place, for turns its sine and cosine, (n, 5 or 7), means over so many s."""
    x, n = view.record[view.moving_column], max(1, round(seconds / view.dt))
    v = np.gradient(running_mean(x, n)) / view.dt
    a = np.gradient(running_mean(v, n)) / view.dt
    weight = [np.sin(x), np.cos(x)] if view.turns else []
    return np.column_stack([a, np.sign(v) * view.moves, v, np.ones(len(x)), x, *weight])


def follows_motion(view: View) -> bool:
    """Whether a line through the motion of one half of a record foretells the force of the other, however fast."""
    half = np.arange(len(view.y)) < len(view.y) // 2
    rows = (motion_rows(view, seconds) for seconds in SET.motion_windows_s)
    return any(all(_foretold(one, view.y, part) > SET.foretold for part in (half, ~half)) for one in rows)


def _foretold(rows: Array, y: Array, half: Mask) -> float:
    spread, left = float(np.var(y[~half])), y[~half] - rows[~half] @ regressed(rows[half], y[half])
    return 1 - float(np.mean(left**2)) / spread if spread else 0.0
