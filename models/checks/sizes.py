"""Sizes: values in another unit, or a power of ten off what the rig can be, in time series and in tables."""

import math
from dataclasses import replace

import numpy as np

from models.checks.estimators import Array
from models.checks.finding import Findings, RecordFinding
from models.checks.positions import POSITIONS
from models.checks.settings import SET
from models.checks.view import View
from models.laws.dipole import too_strong
from models.rigs.columns import TIME
from models.rigs.kinds import surface_of
from models.words.sentences import Quantity


def check_units(view: View) -> Findings:
    """Travel, speed and force outside what such rigs have, and a driven column outside its range."""
    column = view.moving_column
    if column not in view.record.columns:
        return
    travel = float(np.ptp(view.record[column]))
    fastest = float(np.percentile(np.abs(view.speed), 99))
    if view.kind.of_capsule and not view.kind.stage:
        small = 0 < travel < SET.usual_travel_m[0] and (travel > 20 * view.noise or travel < SET.nothing_m)
        if travel > SET.usual_travel_m[1] or small:
            yield _off_its_size(view, column, "units.usual.travel", travel, SET.usual_travel_m, "m")
        elif fastest > SET.usual_m_s[1]:
            yield _off_its_size(view, column, "units.usual.speed", fastest, SET.usual_m_s, "m/s")
        elif view.dt >= SET.seldom_s and 0 < fastest < SET.crawls_m_s:
            line = view.columns_line(TIME, unit="ms")
            yield view.weakens("time_units.slow", TIME, step=view.dt, speed=fastest, line=line)
        if view.kind.follows and view.driven is not None:
            yield from _behind_the_magnet(view, view.driven)
    else:
        usual, unit = (SET.usual_rad_s, "rad/s") if view.turns else (SET.usual_stage_m_s, "m/s")
        if fastest > usual[1]:
            yield _off_its_size(view, column, "units.usual.speed", fastest, usual, unit)
    if view.driven is not None and view.driven not in POSITIONS:
        line = view.columns_line(view.driven, scale=1.0)
        yield from _beyond_its_range(view, view.driven, "units.range.scale", line)
    if view.pushing is not None:
        yield from _of_the_force(view, *view.pushing)


def _beyond_its_range(view: View, column: str, case: str, line: str) -> Findings:
    """A value of `column` that no such column can hold."""
    limits, row = view.kind.range(column), view.kind.first_wrong(column, view.record[column])
    if limits is not None and row is not None:
        value = float(view.record[column][row])
        yield view.stops(case, column, [row], words=limits.words, value=value, line=line)


def _behind_the_magnet(view: View, driven: str) -> Findings:
    """A capsule that follows its magnet travels as far, unless the way is short beside the magnet's range."""
    x, c = view.averaged(view.y, SET.mean_s), view.averaged(view.record[driven], SET.mean_s)
    if not np.std(x) or not np.std(c) or float(np.corrcoef(x, c)[0, 1]) <= SET.way_follows:
        return
    slope = float(np.std(x) / np.std(c))
    reach = view.rig.magnet.magnet_range_m if view.rig.magnet else np.inf
    if slope > SET.way_apart or (slope < 1 / SET.way_apart and np.ptp(c) > SET.way_long * reach):
        yield view.stops("units.follows", beside=driven, ratio=slope, line=view.unit_line(view.measured))


def _of_the_force(view: View, column: str, force: Array) -> Findings:
    """A pull's `force` in N against what such rigs have; else the driving force against the friction of the rig file's
    surface at the same speed, within the bounds of its parameters. Not for a coil whose force falls with distance.
    """
    size = float(np.percentile(np.abs(force), 90))
    if view.kind.drawn and (size > SET.usual_force_N[1] or 0 < size < SET.usual_force_N[0]):
        yield _off_its_size(view, column, "units.usual", size, SET.usual_force_N, "N")
        return
    fades = view.rig.coil is not None and view.rig.coil.coil_range_m is not None
    if fades or not view.moves.any():
        return
    speed, size = (float(np.median(np.abs(values[view.moves]))) for values in (view.speed, force))
    surface = surface_of(view.rig)
    ranges = {p.name: (p.lower, p.value, p.upper) for p in surface.parameters()}
    low, usual, high = (
        float(sum(surface.hold(speed, {name: values[i] for name, values in ranges.items()}))) for i in range(3)
    )
    if usual and not low / SET.size_far <= size <= high * SET.size_far:
        line = view.unit_line(column)
        yield view.weakens("force_size", column, force=size, usual=usual, low=low, high=high, line=line)


def _off_its_size(
    view: View, column: str, case: str, value: float, usual: tuple[float, float], unit: str
) -> RecordFinding:
    """The size `value` of `column` in `unit`, against the `usual` range."""
    low, high = (Quantity(limit, unit) for limit in usual)
    line = view.unit_line(column)
    return view.finding("stops", case, column, value=Quantity(value, unit), low=low, high=high, line=line)


def check_table(view: View) -> Findings:
    """Columns of a table out of range, beyond what such rigs reach, constant, or in contradiction to each other."""
    out = list(_out_of_range(view))
    yield from out
    if out:
        return
    columns = view.record.columns
    driven = [columns[name] for names in view.record.layout.driven for name in names if name in columns]
    conditions = len(np.unique(np.column_stack(driven), axis=0)) if driven else 0
    if conditions >= SET.conditions and not np.ptp(view.y):
        yield view.stops("no_response.constant.table", value=float(view.y[0]), n=conditions)
    if view.measured == "force_N" and "velocity_m_s" in columns:
        yield from _friction(view, columns["velocity_m_s"])
    if "loss_modulus_Pa" in columns:
        yield from _moduli(view)
    if view.kind.runs:
        yield from _mean_speeds(view)


def _out_of_range(view: View) -> Findings:
    for column, values in view.record.columns.items():
        wrong = list(_beyond_its_range(view, column, "units.range", view.unit_line(column)))
        yield from wrong
        low, high, unit = view.kind.usual.get(column, (0.0, math.inf, ""))
        size = float(np.nanmax(np.abs(values)))
        if not wrong and not low <= size <= high:
            yield _off_its_size(view, column, "units.usual", size, (low, high), unit)


def _friction(view: View, speed: Array) -> Findings:
    """Friction resists: its sign is that of the speed, where both directions are measured."""
    against = np.sign(speed) * np.sign(view.y) < 0
    if np.mean(against) > 1 - SET.conditions_against:
        n, line = int(against.sum()), view.turned_line(view.measured)
        yield view.stops("force_sign.table", beside="velocity_m_s", n=n, total=len(against), line=line)
    elif against.any() and (speed > 0).any() and (speed < 0).any() and len(np.unique(np.sign(view.y))) == 1:
        n = int((speed < 0).sum())
        yield view.stops("force_unsigned.table", beside="velocity_m_s", n=n, total=len(speed))


def _moduli(view: View) -> Findings:
    """Loss over storage modulus, as every material has it."""
    usual, (low, high) = float(np.median(view.record["loss_modulus_Pa"] / view.y)), SET.loss_ratio
    if not low <= usual <= high:
        column = "loss_modulus_Pa"
        values = {"ratio": usual, "low": low, "high": high, "line": view.unit_line(column)}
        yield view.stops("units.moduli", column, beside="storage_modulus_Pa", **values)


def _mean_speeds(view: View) -> Findings:
    """The drive's periods beside its spring's."""
    drive = view.rig.drive
    if drive is None or not drive.spring_stiffness_N_per_m:
        return
    own = 2 * math.pi * math.sqrt(drive.inner_mass_kg / drive.spring_stiffness_N_per_m)
    usual = float(np.median(view.record["period_s"]))
    if not own / SET.period_ratio <= usual <= own * SET.period_ratio:
        line = view.columns_line("period_s", unit="ms")
        yield view.stops("units.period", "period_s", period=usual, own=own, line=line)


def check_magnets(view: View) -> Findings:
    """Two cylinders of `[rig.magnet]` so near each other that the dipoles miss their force by more than a tenth."""
    magnets = view.rig.magnets
    cylinders = None if magnets is None else magnets.cylinders()
    if magnets is None or cylinders is None:
        return
    off = too_strong(*cylinders, magnets.height_m, magnets.moments)
    if abs(off) > SET.dipoles:
        heights = magnets.height_m * SET.dipoles_step ** np.arange(SET.dipoles_steps)
        far = [abs(too_strong(*cylinders, h, magnets.moments)) > SET.dipoles for h in heights.tolist()]
        last = int(np.flatnonzero(far)[-1])
        values = {"error": abs(off), "strong": off > 0, "height": magnets.height_m, "limit": SET.dipoles}
        found = view.notes("near_magnets", far=float((*heights, np.inf)[last + 1]), **values)
        yield replace(found, where=f"[rig.magnet] height_m = {magnets.height_m:g}")
