"""Whether records hold the motion that an effect needs in order to show."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import Array, View, running_mean, runs_of
from models.effects.effect import Effect
from models.records.record import Record, where_measured
from models.rigs.rig import Rig


@dataclass(frozen=True)
class Excitation:
    """What the motion in a series of records offers."""

    views: tuple[View, ...]

    @cached_property
    def _strokes(self) -> list[list[tuple[int, int, float]]]:
        out = []
        for view in self.views:
            least = max(2, round(SET.stroke_s / view.dt))
            rows = [
                (a, b, d)
                for d in (1.0, -1.0)
                for a, b in runs_of(view.moves & (np.sign(view.speed) == d))
                if b - a >= least
            ]
            out.append(sorted(rows))
        return out

    @cached_property
    def directions(self) -> set[float]:
        """Which ways the motion goes, +1 and -1."""
        return {d for strokes in self._strokes for _, _, d in strokes}

    @cached_property
    def reversals(self) -> int:
        """How often a stroke is followed by one the other way."""
        return sum(a[2] != b[2] for strokes in self._strokes for a, b in pairwise(strokes))

    @cached_property
    def speeds(self) -> Array:
        """Tenth and ninetieth percentile of the speeds in m/s while in motion, shape (2,)."""
        v = np.concatenate([np.abs(view.speed[view.moves]) for view in self.views])
        return np.percentile(v, [10, 90]) if len(v) else np.zeros(2)

    @cached_property
    def travel(self) -> float:
        """Span in m of the places."""
        ends = [(float(x.min()), float(x.max())) for x in (v.record[v.moving_column] for v in self.views)]
        return max(high for _, high in ends) - min(low for low, _ in ends)

    @cached_property
    def rests(self) -> int:
        """How often a motion starts again after a rest."""
        return sum(
            1
            for view in self.views
            for a, b in runs_of(~view.moves)
            if (b - a) * view.dt > SET.rest_s and b < len(view.t)
        )

    @cached_property
    def longest(self) -> float:
        """Length in s of the longest record."""
        return max(float(view.t[-1] - view.t[0]) for view in self.views)

    @cached_property
    def one_course(self) -> bool:
        """Whether the place is a straight line of the time since the record's start, the same one in all records."""
        t = np.concatenate([(view.t - view.t[0])[view.moves] for view in self.views])
        x = np.concatenate([view.record[view.moving_column][view.moves] for view in self.views])
        return bool(len(t) > 1 and np.ptp(t) * np.ptp(x) > 0 and np.corrcoef(t, x)[0, 1] ** 2 > SET.straight)


Need = Callable[[Excitation], str]


def _both_ways(e: Excitation) -> str:
    return "" if len(e.directions) == 2 else "the motion goes one way only"


def _reversals(e: Excitation) -> str:
    return "" if e.reversals else "the motion never turns round"


def _speeds(e: Excitation) -> str:
    low, high = e.speeds
    return "" if high > SET.speeds_range * low else f"the motion has one speed only ({e.views[0].told(high)}/s)"


def _places(e: Excitation) -> str:
    return "" if e.travel > SET.travel_m else f"the motion covers {e.views[0].told(e.travel)} only"


def _rests(e: Excitation) -> str:
    return "" if e.rests else f"the motion never starts again after a rest of {SET.rest_s:g} s"


def _load(e: Excitation) -> str:
    names = dict.fromkeys(n for view in e.views for n in view.record.layout.optional if n.startswith("load_"))
    loads = [np.abs(v.record[n]) for v in e.views for n in names if n in v.record.columns]
    if not loads:
        return f"no load is logged (column {' or '.join(names)})" if names else "no load is logged"
    low, high = np.percentile(np.concatenate(loads), [5, 95])
    return "" if high > SET.speeds_range * low else f"the logged load is {high:.3g} throughout"


def _turning(e: Excitation) -> str:
    return "" if all(view.turns for view in e.views) else "the axis does not turn"


def _time(e: Excitation) -> str:
    return "" if e.longest > SET.long_s else f"the longest record lasts {e.longest:.3g} s only"


def _wall(e: Excitation) -> str:
    surface = e.views[0].rig.surface
    return "" if surface is None or surface.kind == "gut" else f"there is no wall ({surface.kind})"


def _samples(e: Excitation) -> str:
    rate = min(1 / view.dt for view in e.views)
    return "" if rate > 2 * SET.mains_top else f"it is measured {rate:.3g} times a second, too seldom for a mains tone"


NEEDS: Mapping[str, Need] = MappingProxyType(
    {
        "both_ways": _both_ways,
        "reversals": _reversals,
        "speeds": _speeds,
        "places": _places,
        "rests": _rests,
        "time": _time,
        "load": _load,
        "turning": _turning,
        "samples": _samples,
        "wall": _wall,
    }
)
"""What an effect may name in `needs`, and how its lack is said of a series."""


def _timed(rig: Rig, records: Sequence[Record]) -> tuple[View, ...]:
    return tuple(view for view in (View(where_measured(record), rig) for record in records) if view.timed)


def inseparable(rig: Rig, records: Sequence[Record], effects: Sequence[type[Effect]]) -> dict[str, tuple[str, ...]]:
    """By an effect's id, its declared confounders, and theirs, that no form tells from it in these records: where the
    motion is one course at one speed, whatever goes with the place goes with time as well.
    """
    views = _timed(rig, records)
    if not views or not Excitation(views).one_course:
        return {}
    near = {
        one.id: [e.id for e in effects if one.looks_like(e) and {*one.needs, *e.needs} >= {"places", "time"}]
        for one in effects
    }
    return {name: tuple(sorted(_reached(name, near) - {name})) for name, others in near.items() if others}


def _reached(name: str, near: Mapping[str, Sequence[str]]) -> set[str]:
    """All that leads to `name` over its neighbours, itself too."""
    reached, waiting = {name}, [name]
    while waiting:
        new = set(near[waiting.pop()]) - reached
        reached |= new
        waiting += new
    return reached


def cannot_show(rig: Rig, records: Sequence[Record], effects: Sequence[type[Effect]]) -> dict[str, str]:
    """Why these records cannot show an effect, by the id of each one whose `needs` they do not meet."""
    views = _timed(rig, records)
    if not views:
        return {}
    silent = [view for view in views if check_information(view)]
    if len(silent) == len(views):
        return {effect.id: f"{views[0].measured} is a constant and noise" for effect in effects}
    offered = Excitation(views)
    lacking = {name: said for name, told in NEEDS.items() if (said := told(offered))}
    return {
        effect.id: "; ".join(lacking[name] for name in effect.needs if name in lacking)
        for effect in effects
        if any(name in lacking for name in effect.needs)
    }


Shown = Callable[[Record], tuple[frozenset[str], float]]


def shown_with(rig: Rig, records: Sequence[Record], hidden: Sequence[type[Effect]]) -> Shown:
    """Of the driven motion of one more record: which of the `hidden` effects, that `records` cannot show, they could
    together with it, by id; and how rich it is by itself: its turns and starts, and the logarithm of its range of
    speeds.
    """
    views = _timed(rig, records)

    def shown(motion: Record) -> tuple[frozenset[str], float]:
        alone = View(motion, rig)
        offered, own = Excitation((*views, alone)), Excitation((alone,))
        met = {name for name, told in NEEDS.items() if not told(offered)}
        low, high = (max(float(speed), 1e-9) for speed in own.speeds)
        rich = min(own.reversals, SET.rich_turns) + min(own.rests, SET.rich_starts) + float(np.log(high / low))
        return frozenset(effect.id for effect in hidden if met.issuperset(effect.needs)), rich

    return shown


def check_information(view: View) -> list[RecordFinding]:
    """A measured column, or a place that moves a capsule or an axis by itself, that holds a constant, or a measured one
    that holds a constant and noise and nothing else.
    """
    imposed = (view.moving_column,) if view.kind.imposed else ()
    names = [name for name in (*imposed, view.measured) if name in view.record.columns] if view.timed else []
    for name in names:
        if not np.ptp(values := view.record[name]):
            return [
                view.finding(
                    "no_response",
                    "stops",
                    f"{name}, throughout",
                    f"{name} must change to tell anything; got {values[0]:.6g} throughout: was it measured?",
                    "all values are equal",
                    "log the sensor, or give the column that holds it: [columns]",
                )
            ]
    if not view.timed or view.noise == 0 or len(view.y) < 100:
        return []
    n = max(2, min(len(view.y) // 40, 50))
    smooth = running_mean(view.y, n)
    if float(np.std(smooth)) > SET.alive * 2.0 * view.noise / np.sqrt(2 * n + 1):
        return []
    return [
        view.finding(
            "no_response",
            "weakens",
            f"{view.measured}, throughout",
            f"{view.measured} is a constant and noise: nothing in it follows the motion, so these records tell no"
            " parameter and no effect",
            "its running mean scatters as noise alone would",
            "record strokes to and fro over at least 10 mm, at speeds a factor of five apart, with rests of 1 s",
        )
    ]
