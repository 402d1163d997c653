"""Sizes: values in another unit, or a power of ten off what the rig can be, in time series and in tables."""

import math
from dataclasses import replace

import numpy as np

from models.checks.estimators import Array
from models.checks.excitation import unchanged
from models.checks.finding import Findings, RecordFinding
from models.checks.places import PLACES
from models.checks.settings import SET
from models.checks.view import View
from models.laws.dipole import too_strong
from models.rigs.columns import TIME
from models.rigs.parts import surface_of


def check_units(view: View) -> Findings:
    """Travel, speed and force outside what such rigs do, and a drive that is no place outside what it can be."""
    column = view.moving_column
    if column not in view.record.columns:
        return
    travel = float(np.ptp(view.record[column]))
    fastest = float(np.percentile(np.abs(view.speed), 99))
    if view.kind.of_capsule:
        small = 0 < travel < SET.usual_travel_m[0] and (travel > 20 * view.noise or travel < SET.nothing_m)
        if travel > SET.usual_travel_m[1] or small:
            yield _off_its_size(view, column, f"travels {travel:.3g} m", SET.usual_travel_m, "m")
        elif fastest > SET.usual_m_s[1]:
            yield _off_its_size(view, column, f"moves at {fastest:.3g} m/s", SET.usual_m_s, "m/s")
        elif view.dt >= SET.seldom_s and 0 < fastest < SET.crawls_m_s:
            said = f"samples are {view.dt:.3g} s apart and nothing is faster than {fastest:.3g} m/s: is the time in ms?"
            how = "interval between stamps and speed against what a capsule rig does"
            remedy = f"{view.columns_line(TIME, unit='ms')}, where the file is in ms"
            yield view.weakens("time_units", said, how, remedy, TIME)
        if view.kind.follows and view.driven is not None:
            yield from _behind_the_magnet(view, view.record[view.driven])
    else:
        usual, unit = (SET.usual_rad_s, "rad/s") if view.turns else (SET.usual_stage_m_s, "m/s")
        if fastest > usual[1]:
            yield _off_its_size(view, column, f"moves at {fastest:.3g} {unit}", usual, unit)
    if view.driven is not None and view.driven not in PLACES:
        remedy = f"{view.columns_line(view.driven, scale=1.0)} with the scale that makes it so"
        yield from _beyond_its_range(view, view.driven, remedy)
    if view.pushing is not None:
        yield from _of_the_force(view, *view.pushing)


def _beyond_its_range(view: View, column: str, remedy: str) -> Findings:
    """A value of `column` that no such column can hold."""
    limits, row = view.kind.range(column), view.kind.first_wrong(column, view.record[column])
    if limits is not None and row is not None:
        got = view.record[column][row]
        said = f"{column} must be {limits.words}; got {got:g}: another unit, or another way to say it?"
        yield view.stops("units", said, "values against what the column can hold", remedy, column, [row])


def _behind_the_magnet(view: View, carriage: Array) -> Findings:
    """A capsule that follows its magnet goes as far as that goes: neither several times as far, nor a fraction of a way
    that is long against the magnet's reach.
    """
    x, c = view.averaged(view.y, SET.mean_s), view.averaged(carriage, SET.mean_s)
    if not np.std(x) or not np.std(c) or float(np.corrcoef(x, c)[0, 1]) <= SET.way_follows:
        return
    slope = float(np.std(x) / np.std(c))
    reach = view.rig.magnet.magnet_range_m if view.rig.magnet else np.inf
    if slope > SET.way_apart or (slope < 1 / SET.way_apart and np.ptp(c) > SET.way_long * reach):
        yield view.stops(
            "units",
            f"{view.measured} follows {view.driven}, but goes {slope:.3g} times as far: another unit?",
            "standard deviations of the two places, and their correlation",
            view.unit_line(view.measured),
            f"{view.measured} against {view.driven}",
        )


def _of_the_force(view: View, column: str, force: Array) -> Findings:
    """A pull's `force` in N against what such rigs do, else what drives the capsule against that with which the rig
    file's surface holds it at the same speed, as far as surfaces vary; nothing for a coil whose force falls with the
    distance.
    """
    size = float(np.percentile(np.abs(force), 90))
    if view.kind.drawn and (size > SET.usual_force_N[1] or 0 < size < SET.usual_force_N[0]):
        yield _off_its_size(view, column, f"is of the size of {size:.3g} N", SET.usual_force_N, "N")
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
        yield view.weakens(
            "force_size",
            f"{column} {'is' if view.kind.drawn else 'makes'} {size:.3g} N at the usual speed, where what the rig file"
            f" states holds the capsule with {usual:.3g} N ({low:.2g} to {high:.2g} N as far as that varies): another"
            " unit, another surface?",
            "median of the force in motion against the friction law",
            f"{view.unit_line(column)}; or [capsule], [tissue] and [surface] as they were",
            column,
        )


def _off_its_size(view: View, column: str, what: str, usual: tuple[float, float], unit: str) -> RecordFinding:
    """What the values of `column` do, against the `usual` range in `unit`."""
    said = f"{column} {what}; such rigs do {usual[0]:g} to {usual[1]:g} {unit}: another unit?"
    how = "size of the values against what a capsule rig can be"
    return view.stops("units", said, how, view.unit_line(column), column)


def check_table(view: View) -> Findings:
    """Columns of a table with a value that they cannot have, or that reach what no such rig does; a measured one that
    is the same under every condition; and what the columns of one kind tell of each other.
    """
    out = list(_out_of_range(view))
    yield from out
    if out:
        return
    columns = view.record.columns
    driven = [columns[name] for names in view.record.layout.driven for name in names if name in columns]
    conditions = len(np.unique(np.column_stack(driven), axis=0)) if driven else 0
    if conditions >= SET.conditions and not np.ptp(view.y):
        yield unchanged(view, view.measured, f"all values are equal, under {conditions} conditions")
    if view.measured == "force_N" and "velocity_m_s" in columns:
        yield from _friction(view, columns["velocity_m_s"])
    if "loss_modulus_Pa" in columns:
        yield from _moduli(view)
    if view.kind.runs:
        yield from _mean_speeds(view)


def _out_of_range(view: View) -> Findings:
    for column, values in view.record.columns.items():
        wrong = list(_beyond_its_range(view, column, view.unit_line(column)))
        yield from wrong
        low, high, unit = view.kind.usual.get(column, (0.0, math.inf, ""))
        size = float(np.nanmax(np.abs(values)))
        if not wrong and not low <= size <= high:
            yield _off_its_size(view, column, f"goes up to {size:.3g}", (low, high), unit)


def _friction(view: View, speed: Array) -> Findings:
    """Friction resists: its sign is that of the speed, wherever it is measured both ways."""
    against, where = np.sign(speed) * np.sign(view.y) < 0, f"{view.measured} against velocity_m_s"
    if np.mean(against) > 1 - SET.conditions_against:
        said = f"{view.measured} has the sign of a force that drives the motion which it should resist"
        how = f"{int(against.sum())} of {len(against)} conditions with force and speed of opposite signs"
        yield view.stops("force_sign", said, how, view.turned_line(view.measured), where)
    elif against.any() and (speed > 0).any() and (speed < 0).any() and len(np.unique(np.sign(view.y))) == 1:
        said = f"{view.measured} has one sign at speeds of both: its sign was not logged"
        how = f"{int((speed < 0).sum())} of {len(speed)} conditions at negative speeds"
        remedy = "log both with their signs, or both without"
        yield view.stops("force_unsigned", said, how, remedy, where)


def _moduli(view: View) -> Findings:
    """Loss over storage modulus, as every material has it."""
    usual, (low, high) = float(np.median(view.record["loss_modulus_Pa"] / view.y)), SET.loss_ratio
    if not low <= usual <= high:
        yield view.stops(
            "units",
            f"loss_modulus_Pa is {usual:.3g} times storage_modulus_Pa; materials have {low:g} to {high:g}: another unit"
            " of one of the two?",
            "median of the ratio",
            view.unit_line("loss_modulus_Pa"),
            "loss_modulus_Pa against storage_modulus_Pa",
        )


def _mean_speeds(view: View) -> Findings:
    """The drive's periods beside its spring's."""
    drive = view.rig.drive
    if drive is None or not drive.spring_stiffness_N_per_m:
        return
    own = 2 * math.pi * math.sqrt(drive.inner_mass_kg / drive.spring_stiffness_N_per_m)
    usual = float(np.median(view.record["period_s"]))
    if not own / SET.period_ratio <= usual <= own * SET.period_ratio:
        yield view.stops(
            "units",
            f"period_s is {usual:.3g}, where the inner mass swings on its spring in {own:.3g} s: another unit, or a"
            " frequency?",
            "median of the periods against the spring and the mass of the rig file",
            f"{view.columns_line('period_s', unit='ms')}, where the file is in ms",
            "period_s",
        )


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
        told = view.notes(
            "near_magnets",
            f"the dipoles of [rig.magnet] are {abs(off):.0%} too {'strong' if off > 0 else 'weak'} for cylinders of"
            f" this size at {magnets.height_m:g} m; within {SET.dipoles:.0%} they hold from"
            f" {(*heights, np.inf)[last + 1]:.2g} m on",
            "force between the charges on both cylinders' ends against that of two dipoles",
            "give the measured magnet_stiffness_N_per_m under [rig], or measure further away",
        )
        yield replace(told, where=f"[rig.magnet] height_m = {magnets.height_m:g}")
