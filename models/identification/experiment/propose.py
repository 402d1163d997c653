"""The motion that tells best what the records leave confounded: random motions, the best of them varied."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.checks.excitation import Shown
from models.identification.experiment.plan import Plan, Room, random_plan, varied
from models.identification.experiment.question import Candidate, Question, question
from models.identification.finding import NEXT_CSV, Proposal, Separation
from models.identification.fitting.fit import parallel
from models.identification.kind import Kind
from models.identification.search.fitted_model import FittedModel
from models.identification.search.forward_selection import Search
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.kinds import KINDS


def propose(
    kind: Kind, records: Sequence[Record], found: Search, shown: Shown | None, rng: np.random.Generator
) -> Proposal | None:
    """A motion for the next record of a rig that is led along a path; None where nothing is confounded or out of sight,
    and for other kinds of rig.

    It is as long as half a record is, and stays within the places and speeds that the `records` hold. It puts the
    rivals of the effects that are `found` as many standard deviations off as can be found in a bounded search; where
    there are none, it makes `shown` (of a motion, the effects that it could show and the records cannot, and how rich
    it is) as large; None for `shown` says that nothing is out of sight.
    """
    rig = KINDS[kind.name]
    if not rig.led:
        return None
    room = Room.of(records, rig.layout.driven[0][0])
    if not room.speed > 0 or not room.span > 0:
        return None

    def candidate(effect: str, model: FittedModel) -> Candidate:
        return Candidate(effect, model.effects, kind.nominal() | model.thetas[0])

    pairs = [(candidate(effect, m), candidate(rival.effect, rival.fitted)) for effect, m, rival in found.doubts]
    if pairs:
        seconds = (SET.plan_read_s if rig.drawn else SET.slow_plan_read_s) / len(records)
        read = [record.beginning(seconds) for record in records]
        asked = [question(kind, read, *pair, rng) for pair in pairs[: SET.questions]]
        plan, apart = _best(kind, room, asked, read, rng)
    elif shown is None:
        return None
    else:
        asked, apart = [], []
        plan = _richest(kind, replace(room, length=max(room.length, SET.plan_shows_s)), shown, rng)
    motion = plan.record(kind.name)
    shows = () if shown is None else tuple(sorted(shown(motion)[0]))
    if not pairs and not shows:
        return None
    times, places = plan.waypoints()
    return Proposal(
        column=room.column,
        times_s=times,
        places_m=places,
        motion={name: motion[name] for name in ("t_s", room.column)},
        separations=tuple(
            Separation(q.truth.effect, q.rival.effect, sure, *max(q.apart.items(), key=lambda row: row[1]))
            for q, sure in zip(asked, apart, strict=True)
        ),
        shows=shows,
    )


def _richest(kind: Kind, room: Room, shown: Shown, rng: np.random.Generator) -> Plan:
    """The random plan that shows most effects; of those the richest."""

    def worth(plan: Plan) -> tuple[int, float]:
        effects, rich = shown(plan.record(kind.name))
        return len(effects), rich

    return max((random_plan(room, rng) for _ in range(SET.plan_effort[0])), key=worth)


def words_of(proposal: Proposal | None) -> str | None:
    """What is proposed and what it would tell, in a sentence; None where nothing is."""
    if proposal is None:
        return None
    t, x = proposal.times_s, proposal.places_m
    low, high = (round(1e3 * float(place), 1) + 0.0 for place in (x.min(), x.max()))  # 0.0 for -0.0
    steps, spans = np.diff(x), np.diff(t)
    speeds = np.abs(steps[steps != 0] / spans[steps != 0])
    turns = int(np.sum(np.diff(np.sign(steps[steps != 0])) != 0))
    said = [
        f"tell {one.effect} from {one.rival} by {one.standard_deviations:.1f} standard deviations, where"
        f" {one.best_record} puts them {one.so_far:.1f} apart"
        for one in proposal.separations
    ]
    if proposal.shows:
        said.append(f"show {', '.join(proposal.shows)}, if there")
    return (
        f"record the motion of {NEXT_CSV} ({t[-1]:.0f} s within {low:.1f} to {high:.1f} mm at"
        f" {1e3 * speeds.min():.2g} to {1e3 * speeds.max():.2g} mm/s, {turns} {'turn' if turns == 1 else 'turns'},"
        f" {spans[steps == 0].sum():.1f} s at rest), which should {' and '.join(said)}"
    )


def _best(
    kind: Kind, room: Room, asked: Sequence[Question], read: Sequence[Record], rng: np.random.Generator
) -> tuple[Plan, list[float]]:
    """The plan whose least separation is largest, and its separations; the last few with the rivals truly fitted."""

    def worth(plan: Plan) -> float:
        motion = plan.record(kind.name)
        return min(q.separation(motion) for q in asked)

    def judged(plans: Sequence[Plan]) -> list[tuple[float, Plan]]:
        return list(zip(parallel(worth, plans), plans, strict=True))

    first, again, best, rounds = SET.plan_effort if KINDS[kind.name].drawn else SET.slow_effort
    rows = judged([random_plan(room, rng) for _ in range(first)])
    for _ in range(rounds):
        rows = sorted(rows, key=lambda row: -row[0])[:best]
        rows += judged([varied(rows[k % best][1], rng) for k in range(again)])
    finals = [plan for _, plan in sorted(rows, key=lambda row: -row[0])[:best]]
    apart = [[q.refitted(read, plan.record(kind.name)) for q in asked] for plan in finals]
    farthest = max(range(len(finals)), key=lambda k: min(apart[k]))
    return finals[farthest], apart[farthest]
