"""Values a power of ten off what the rig can be."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.instrument.resolution import PLACES
from models.checks.settings import SET
from models.checks.view import Array, View, running_mean
from models.rigs.columns import TIME
from models.rigs.parts import surface_of


def check_units(view: View) -> list[RecordFinding]:
    """Travel, speed and force outside what such rigs do."""
    if not view.timed or view.moving_column not in view.record.columns:
        return []
    x = view.record[view.moving_column]
    travel, fastest = float(np.ptp(x)), float(np.percentile(np.abs(view.speed), 99))
    out = []
    if view.kind.of_capsule:
        small = 0 < travel < SET.usual_travel_m[0] and (travel > 20 * view.noise or travel < SET.nothing_m)
        if travel > SET.usual_travel_m[1] or small:
            out.append(off_its_size(view, view.moving_column, f"travels {travel:.3g} m", SET.usual_travel_m, "m"))
        elif fastest > SET.usual_m_s[1]:
            out.append(off_its_size(view, view.moving_column, f"moves at {fastest:.3g} m/s", SET.usual_m_s, "m/s"))
        elif view.dt >= SET.seldom_s and 0 < fastest < SET.crawls_m_s:
            out.append(_slow(view, fastest))
        if view.kind.follows and view.driven is not None and view.measured in view.record.columns:
            out += _behind_the_magnet(view, view.record[view.driven])
    else:
        usual, unit = (SET.usual_rad_s, "rad/s") if view.turns else (SET.usual_stage_m_s, "m/s")
        if fastest > usual[1]:
            out.append(off_its_size(view, view.moving_column, f"moves at {fastest:.3g} {unit}", usual, unit))
    out += _of_the_drive(view)
    out += _of_the_force(view)
    return out


def _of_the_drive(view: View) -> list[RecordFinding]:
    """A drive that is no place (on or off, a current, a voltage) outside what such a column can hold."""
    column = view.driven
    if column is None or column in PLACES:
        return []
    remedy = f"{view.columns_line(column, scale=1.0)} with the scale that makes it so"
    return beyond_its_range(view, column, remedy)


def beyond_its_range(view: View, column: str, remedy: str) -> list[RecordFinding]:
    """A value of `column` that no such column can hold."""
    limits, row = view.kind.range(column), view.kind.first_wrong(column, view.record[column])
    if limits is None or row is None:
        return []
    return [
        view.finding(
            "units",
            "stops",
            f"{column}, {view.at([row])}",
            f"{column} must be {limits.words}; got {view.record[column][row]:g}: another unit, or another way to say"
            " it?",
            "values against what the column can hold",
            remedy,
        )
    ]


def _behind_the_magnet(view: View, carriage: Array) -> list[RecordFinding]:
    """A capsule that follows its magnet goes as far as that goes: neither several times as far, nor a fraction of a way
    that is long against the magnet's reach.
    """
    n = max(1, round(SET.mean_s / view.dt))
    x, c = running_mean(view.y, n), running_mean(carriage, n)
    if not np.std(x) or not np.std(c):
        return []
    slope, follows = float(np.std(x) / np.std(c)), float(np.corrcoef(x, c)[0, 1]) > SET.way_follows
    reach = view.rig.magnet.magnet_range_m if view.rig.magnet else np.inf
    if not follows or not (slope > SET.way_apart or (slope < 1 / SET.way_apart and np.ptp(c) > SET.way_long * reach)):
        return []
    return [
        view.finding(
            "units",
            "stops",
            f"{view.measured} against {view.driven}, throughout",
            f"{view.measured} follows {view.driven}, but goes {slope:.3g} times as far: another unit?",
            "standard deviations of the two places, and their correlation",
            view.unit_line(view.measured),
        )
    ]


def _of_the_force(view: View) -> list[RecordFinding]:
    """A pull's force against what such rigs do, else what drives the capsule against what holds it."""
    if view.pushing is None:
        return []
    column, force = view.pushing
    size = float(np.percentile(np.abs(force), 90))
    if view.kind.drawn and (size > SET.usual_force_N[1] or 0 < size < SET.usual_force_N[0]):
        return [off_its_size(view, column, f"is of the size of {size:.3g} N", SET.usual_force_N, "N")]
    return _against_the_surface(view, column, force)


def _against_the_surface(view: View, column: str, force: Array) -> list[RecordFinding]:
    """The `force` in N against that with which the rig file's surface holds the capsule at the same speed, as far as
    surfaces vary; nothing for a coil whose force falls with the distance.
    """
    fades = view.rig.coil is not None and view.rig.coil.coil_range_m is not None
    if fades or not view.moves.any():
        return []
    speed, size = (float(np.median(np.abs(values[view.moves]))) for values in (view.speed, force))
    surface = surface_of(view.rig)
    ranges = [(p.name, (p.lower, p.value, p.upper)) for p in surface.parameters()]
    lowest, usual, highest = (
        float(sum(surface.hold(speed, {name: values[i] for name, values in ranges}))) for i in range(3)
    )
    if not usual or lowest / SET.size_far <= size <= highest * SET.size_far:
        return []
    what = "is" if view.kind.drawn else "makes"
    return [
        view.finding(
            "force_size",
            "weakens",
            f"{column}, throughout",
            f"{column} {what} {size:.3g} N at the usual speed, where what the rig file states holds the capsule with"
            f" {usual:.3g} N ({lowest:.2g} to {highest:.2g} N as far as that varies): another unit, another surface?",
            "median of the force in motion against the friction law",
            f"{view.unit_line(column)}; or [capsule], [tissue] and [surface] as they were",
        )
    ]


def off_its_size(view: View, column: str, what: str, usual: tuple[float, float], unit: str) -> RecordFinding:
    """What the values of `column` do, against the `usual` range in `unit`."""
    return view.finding(
        "units",
        "stops",
        f"{column}, throughout",
        f"{column} {what}; such rigs do {usual[0]:g} to {usual[1]:g} {unit}: another unit?",
        "size of the values against what a capsule rig can be",
        view.unit_line(column),
    )


def _slow(view: View, fastest: float) -> RecordFinding:
    return view.finding(
        "time_units",
        "weakens",
        "t_s, throughout",
        f"samples are {view.dt:.3g} s apart and nothing is faster than {fastest:.3g} m/s: is the time in ms?",
        "interval between stamps and speed against what a capsule rig does",
        f"{view.columns_line(TIME, unit='ms')}, where the file is in ms",
    )
