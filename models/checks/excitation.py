"""Whether records hold the motion that an effect needs in order to show."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from models.checks.estimators import Array, running_mean, runs_of
from models.checks.finding import Findings
from models.checks.settings import SET
from models.checks.speeds import follows_motion
from models.checks.view import TEXT, View
from models.effects.effect import Effect
from models.records.record import Record, where_measured
from models.rigs.columns import LOADS
from models.rigs.rig import Rig


@dataclass(frozen=True)
class Excitation:
    """What the motion in a series of records offers."""

    views: tuple[View, ...]

    @cached_property
    def _strokes(self) -> list[list[tuple[int, int, float]]]:
        return [view.strokes(SET.stroke_s, 2) for view in self.views]

    @cached_property
    def reversals(self) -> int:
        """How often a stroke is followed by one in the other direction."""
        return sum(a[2] != b[2] for strokes in self._strokes for a, b in pairwise(strokes))

    @cached_property
    def speeds(self) -> Array:
        """Tenth and ninetieth percentile of the speeds in m/s while in motion, shape (2,)."""
        v = np.concatenate([np.abs(view.speed[view.moves]) for view in self.views])
        return np.percentile(v, [10, 90]) if len(v) else np.zeros(2)

    @cached_property
    def rests(self) -> int:
        """How often a motion starts again after a rest."""
        stops = ((view, a, b) for view in self.views for a, b in runs_of(~view.moves))
        return sum((b - a) * view.dt > SET.rest_s and b < len(view.t) for view, a, b in stops)

    @cached_property
    def one_course(self) -> bool:
        """Whether the position is one linear function of the time since the start, the same in all records."""
        t = np.concatenate([(view.t - view.t[0])[view.moves] for view in self.views])
        x = np.concatenate([view.record[view.moving_column][view.moves] for view in self.views])
        return bool(len(t) > 1 and np.ptp(t) * np.ptp(x) > 0 and np.corrcoef(t, x)[0, 1] ** 2 > SET.straight)

    @cached_property
    def travel(self) -> float:
        """From the lowest to the highest position of all records, in m (rad)."""
        places = [view.record[view.moving_column] for view in self.views]
        return max(float(x.max()) for x in places) - min(float(x.min()) for x in places)

    @cached_property
    def lacking(self) -> dict[str, str]:
        """What effects may name in `needs` and the series does not offer, by name, with a sentence."""
        (low, high), (view, *_) = self.speeds, self.views
        longest, rate = max(float(v.t[-1] - v.t[0]) for v in self.views), min(1 / view.dt for view in self.views)
        surface, names = view.rig.surface, [name for name in view.record.layout.optional if name in LOADS]
        there = [n for n in names if all(n in v.record.columns for v in self.views)]
        loads = [np.concatenate([np.abs(v.record[n]) for v in self.views]) for n in there]
        ends = [np.percentile(one, [5, 95]) for one in loads]
        heavy = max((float(high) for _, high in ends), default=0.0)
        no_load = "load_constant" if loads else "load_column" if names else "load"
        offered = {
            "both_ways": len({sign for strokes in self._strokes for _, _, sign in strokes}) == 2,
            "reversals": self.reversals,
            "speeds": high > SET.speeds_range * low,
            "places": self.travel > SET.travel_m,
            "rests": self.rests,
            "time": longest > SET.long_s,
            "load": any(high > SET.speeds_range * low for low, high in ends),
            "logged": any(varied(n, np.concatenate([v.record[n] for v in self.views])) for n in there),
            "turning": all(view.turns for view in self.views),
            "samples": rate > 2 * SET.mains_top,
            "wall": surface is None or surface.kind == "gut",
        }
        values = {
            "speed": view.length(float(high), "/s"),
            "travel": view.length(self.travel),
            "rest": SET.rest_s,
            "rate": rate,
        }
        values |= {"longest": longest, "names": names, "load": heavy, "surface": surface and surface.kind}
        return {
            need: TEXT(f"lacking.{no_load if need in ('load', 'logged') else need}", **values)
            for need, met in offered.items()
            if not met
        }


def varied(column: str, values: Array) -> bool:
    """Whether a logged input changes by itself, by a share of its size or kelvins: less may follow from the motion."""
    low, high = np.percentile(values, [5, 95])
    least = SET.warmer_K if column == "temperature_degC" else SET.load_varied * max(abs(low), abs(high))
    return bool(high - low > least)


def _timed(rig: Rig, records: Sequence[Record]) -> tuple[View, ...]:
    return tuple(view for view in (View(where_measured(record), rig) for record in records) if view.timed)


def inseparable(rig: Rig, records: Sequence[Record], effects: Sequence[type[Effect]]) -> dict[str, tuple[str, ...]]:
    """By an effect's id, its declared confounders, and theirs, that these records cannot separate from it in any form:
    in one pass at one speed, whatever depends on position depends on time as well; over less than a quarter turn, a
    weight on a lever is a spring.
    """
    views = _timed(rig, records)
    if not views:
        return {}
    seen, forces = Excitation(views), {effect.id for effect in effects if effect.answers("force")}
    little_turn = all(view.turns for view in views) and seen.travel < np.pi / 2

    def alike(one: type[Effect], other: type[Effect]) -> bool:
        needs = {*one.needs, *other.needs}
        turned = little_turn and "turning" in needs and {one.id, other.id} <= forces
        return one.looks_like(other) and (turned or (seen.one_course and needs >= {"places", "time"}))

    near = {one.id: [e.id for e in effects if alike(one, e)] for one in effects}
    return {name: tuple(sorted(_reached(name, near) - {name})) for name, others in near.items() if others}


def _reached(name: str, near: Mapping[str, Sequence[str]]) -> set[str]:
    """`name` and all that is connected to it over neighbours."""
    reached = {name}
    while new := {other for one in reached for other in near[one]} - reached:
        reached |= new
    return reached


def cannot_show(rig: Rig, records: Sequence[Record], effects: Sequence[type[Effect]]) -> dict[str, str]:
    """Why these records cannot show an effect, by the id of each one whose `needs` they do not meet."""
    views = _timed(rig, records)
    if not views:
        return {}
    if all(silent_response(view) for view in views):
        return dict.fromkeys((effect.id for effect in effects), TEXT("lacking.response", column=views[0].measured))
    lacking = Excitation(views).lacking
    why = {effect.id: "; ".join(lacking[name] for name in effect.needs if name in lacking) for effect in effects}
    return {effect: said for effect, said in why.items() if said}


Shown = Callable[[Record], tuple[frozenset[str], float]]


def shown_with(rig: Rig, records: Sequence[Record], hidden: Sequence[type[Effect]]) -> Shown:
    """A function of the driven motion of one more record. It gives the ids of the `hidden` effects that `records` could
    show together with it, and how rich the motion is: its reversals, its starts and the logarithm of its range of
    speeds.
    """
    views = _timed(rig, records)

    def shown(motion: Record) -> tuple[frozenset[str], float]:
        alone = View(motion, rig)
        lacking, own = Excitation((*views, alone)).lacking, Excitation((alone,))
        low, high = (max(float(speed), 1e-9) for speed in own.speeds)
        rich = min(own.reversals, SET.rich_turns) + min(own.rests, SET.rich_starts) + float(np.log(high / low))
        return frozenset(effect.id for effect in hidden if not lacking.keys() & set(effect.needs)), rich

    return shown


def silent_response(view: View) -> bool:
    """Whether `check_information` finds no response."""
    return any(True for _ in check_information(view))


def check_information(view: View) -> Findings:
    """A measured column or an imposed position that is constant, or a measured one that is a constant and noise."""
    for name in ((view.moving_column,) if view.kind.imposed else ()) + (view.measured,):
        if not np.ptp(view.record[name]):
            yield view.stops("no_response.constant", name, value=float(view.record[name][0]))
            return
    n = max(2, min(len(view.y) // 40, 50))
    alive = SET.alive * 2.0 * view.noise / np.sqrt(2 * n + 1)
    silent = view.noise > 0 and len(view.y) >= 100 and float(np.std(running_mean(view.y, n))) <= alive
    if silent and not (view.kind.stage and view.kind.imposed and follows_motion(view)):
        yield view.weakens("no_response")
