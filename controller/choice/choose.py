"""The model and the controller that lead: those whose worst error over all possible models is least."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from controller.choice.trial import Mission, Outcome, tried
from controller.choice.world import Possible, Push
from controller.drives import envelope_of
from controller.limits import Limits
from controller.model.control_model import ControlModel
from controller.step.compiled import compiled
from models.words.quantities import quantity
from models.words.sentences import Sentences
from models.workers import cores, each

TEXT: Final = Sentences(__file__)
TIE: Final = 1.05
"""Ratio of errors up to which two controllers count as equal, so that the simpler one leads."""
PLAIN: Final = "pid"
"""The controller that needs no friction model, with which every choice is compared."""
ORDER: Final = ("feedforward", "mpc", PLAIN)
"""The controllers that are compared on a drive that pushes the body, the simpler first of equal ones."""
HOPELESS: Final = 2.0
"""Ratio of its error to the least plain one in the likeliest world above which a candidate is given up."""
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Candidate:
    """A `controller` with the model of a `stage`; a lower `rank` is simpler. Records may have `refuted` that model."""

    stage: str
    controller: str
    model: ControlModel
    rank: tuple[int, int]
    refuted: bool = False

    @property
    def plain(self) -> bool:
        """Whether it needs nothing that records showed, so that no other may lose against it."""
        return self.rank[0] == 0

    @property
    def words(self) -> str:
        return TEXT("candidate", stage=self.stage, controller=self.controller)


@dataclass
class Row:
    """The outcomes of a candidate by world, and the `worlds` that count."""

    candidate: Candidate
    worlds: Sequence[str]
    outcomes: dict[str, Outcome] = field(default_factory=dict)

    @property
    def worst(self) -> float:
        return max((one.cost for name, one in self.outcomes.items() if name in self.worlds), default=0.0)

    @property
    def missing(self) -> list[str]:
        """The worlds in which it was not tried to the end."""
        return [name for name in self.worlds if name not in self.outcomes or not self.outcomes[name].whole]

    @property
    def kept(self) -> list[str]:
        """The worlds in which it breaks no limit."""
        return [name for name in self.worlds if self.outcomes[name].cost < math.inf]

    @property
    def expected(self) -> float:
        """The mean over the worlds that count and were tried to the end, where there are any: others give a bound from
        below.
        """
        tried = [one for name, one in self.outcomes.items() if name in self.worlds]
        costs = [one.cost for one in tried if one.whole] or [one.cost for one in tried]
        return sum(costs) / len(costs) if costs else math.inf


@dataclass(frozen=True)
class Chosen:
    """What leads: `stage` with `controller`; the error in m that is `expected` of each stage with its best controller,
    the mean over the models it was tried in, and `why` in words; whether each candidate `fails` in some world.
    """

    stage: str
    controller: str
    expected: Mapping[str, float]
    why: str
    fails: bool = False

    def document(self) -> dict[str, Any]:
        """The key `chosen` of a run's JSON object."""
        known = {stage: error if math.isfinite(error) else None for stage, error in self.expected.items()}
        return {"stage": self.stage, "controller": self.controller, "expected_rmse_m": known, "why": self.why}


class Comparison:
    """Every candidate in every world, as far as it must be tried to know which has the least worst error."""

    def __init__(
        self,
        mission: Mission,
        candidates: Sequence[Candidate],
        worlds: Mapping[str, Push],
        world: Callable[[str, ControlModel], ControlModel],
        report: Progress,
    ) -> None:
        """`world` gives the model that is the world of that name, for a rig as the leading model has it; `worlds` what
        each lacks.
        """
        self._mission, self._piece, self._worlds, self._report = mission, mission.piece(), list(worlds), report
        self._world: Callable[[str, ControlModel], Possible] = lambda name, own: (world(name, own), worlds[name])
        self.rows = [Row(one, self._worlds) for one in candidates]
        self.runs = 0
        self.broken = 0
        """Worlds in which each row breaks a limit, at least."""
        self.lost: dict[str, str] = {}
        """Stages that lose against a plain row, with the name of the first world in which they do."""

    def _try(self, pairs: Sequence[tuple[Row, str]], most_m: float = math.inf) -> None:
        """Fill in the outcomes of `pairs`, side by side. Each world has a seed of its own."""
        made = [(row.candidate, name, self._world(name, row.candidate.model)) for row, name in pairs]
        for candidate, _, (world, _) in made:  # once, before workers inherit them
            model, limits = candidate.model, self._mission.limits
            _ = model.sharp.kernels, model.kernels, world.sharp.kernels, world.sharp.measured
            compiled(candidate.controller, model, envelope_of(model.drive, limits))

        def run(one: tuple[Candidate, str, Possible]) -> Outcome:
            candidate, name, world = one
            seed, leads = 1 + self._worlds.index(name), (candidate.model, candidate.controller)
            return tried(self._mission, self._piece, *leads, world, most_m, seed)

        for (row, name), outcome in zip(pairs, each(run, made), strict=True):
            row.outcomes[name] = outcome
        self.runs += len(pairs)
        share = self.runs / (len(self.rows) * len(self._worlds))
        self._report(TEXT("progress", runs=self.runs), min(share, 1.0))

    def best(self) -> Row:
        """The row that leads. Where all break a limit somewhere, those that do in fewest worlds are compared in the
        worlds in which they do not.
        """
        plain = [row for row in self.rows if row.candidate.plain]
        self._try([(row, self._worlds[0]) for row in plain])
        most_m = HOPELESS * min((row.worst for row in plain), default=math.inf)
        self._try([(row, self._worlds[0]) for row in self.rows if row not in plain], most_m)
        leading = self._least_of(self.rows)
        if leading is None:
            kept = max(len(row.kept) for row in self.rows)
            self.broken, left = len(self._worlds) - kept, [row for row in self.rows if len(row.kept) == kept]
            for row in left:
                row.worlds = row.kept
            leading = self._least_of(left)
        assert leading is not None
        return leading

    def _least_of(self, rows: Sequence[Row]) -> Row | None:
        """The least worst of the `rows` that lose against no plain one; of all where only a model that the records
        refute is left; None where all break a limit.
        """
        left, plain, losing = list(rows), [row for row in rows if row.candidate.plain], list[Row]()
        most = dict[str, float]()
        while leading := self._least_worst(left, most):
            lost = "" if leading in plain else next(filter(None, (self._loses(leading, row) for row in plain)), "")
            if not lost:
                return losing[0] if losing and leading.candidate.refuted else leading
            losing.append(leading)
            self.lost.setdefault(leading.candidate.stage, lost)
            left.remove(leading)
            known = [row for row in plain if not row.missing and row.worst < math.inf]
            most = {name: min(_bearable(row, name) for row in known) for name in self._worlds}
        return None

    def _least_worst(self, rows: Sequence[Row], most: Mapping[str, float]) -> Row | None:
        """The row of least worst error, of those equal within `TIE` the simplest; None where all break a limit. A row
        that is not plain has lost where its error in a world is above `most`: there it is tried first, and given up.
        """
        least = min((row.worst for row in rows if not row.missing and not self._behind(row, most)), default=math.inf)
        for row in sorted(rows, key=lambda row: row.worst):
            own = {} if row.candidate.plain else most
            while row.missing and row.worst <= TIE * least and not self._behind(row, most):
                tried = sorted(row.missing, key=lambda name: own.get(name, math.inf))[: cores()]
                most_m = max(own.get(name, math.inf) for name in tried)
                self._try([(row, name) for name in tried], min(TIE * least, most_m))
            if not row.missing and not self._behind(row, most):
                least = min(least, row.worst)
        equal = [row for row in rows if not row.missing and row.worst <= TIE * least < math.inf]
        return min((row for row in equal if not self._behind(row, most)), key=lambda r: r.candidate.rank, default=None)

    def _behind(self, row: Row, most: Mapping[str, float]) -> bool:
        """Whether a row that is not plain has an error above `most` in a world, which is noted."""
        found = () if row.candidate.plain else row.worlds
        lost = next((k for k in found if k in row.outcomes and row.outcomes[k].cost > most.get(k, math.inf)), "")
        if lost:
            self.lost.setdefault(row.candidate.stage, lost)
        return bool(lost)

    def _loses(self, leading: Row, plain: Row) -> str:
        """The first world in which `leading` loses against the `plain` row, or "". The plain row is tried no longer
        than until it is the worse one, but everywhere before it counts: one that breaks a limit somewhere is no better
        choice.
        """
        for name in (name for name in leading.worlds if name in plain.worlds):
            own, known = leading.outcomes[name].cost, plain.outcomes.get(name)
            if known is None or not (known.whole or known.cost >= own):
                self._try([(plain, name)], own)
            if _bearable(plain, name) < own:
                self._try([(plain, other) for other in plain.missing])
                if _bearable(plain, name) < own:
                    return name
        return ""


def _bearable(plain: Row, name: str) -> float:
    """The error in m in a world above which a row loses against the `plain` one: by more than the share `TIE` of the
    worst that the plain one risks.
    """
    return plain.outcomes[name].cost + (TIE - 1) * plain.worst


def _most_N(model: ControlModel, limits: Limits) -> float:
    """The greatest force on the capsule that drive or limits allow."""
    drive, p = model.drive, model.theta.base
    own = p.get("force_N") or abs(drive.force(0.0, 0.0, drive.gap_limit_m or limits.current_A, p))
    return max(limits.force_N, float(own))


def choose(
    mission: Mission,
    candidates: Sequence[Candidate],
    worlds: Mapping[str, Push],
    world: Callable[[str, ControlModel], ControlModel],
    report: Progress,
    barred: Mapping[str, str] | None = None,
) -> Chosen:
    """The candidate that leads on `mission`, and why; `worlds` are the possible models, the likeliest first, with what
    each lacks on the records: one that lacks more than drive and limits allow is none. `barred` says why other stages
    are no candidates.
    """
    most_N = _most_N(candidates[0].model, mission.limits)
    able = {name: push for name, push in worlds.items() if push.force_N <= most_N}
    compared = Comparison(mission, candidates, able or dict.fromkeys(worlds, Push()), world, report)
    leading = compared.best()
    stages = {row.candidate.stage: row for row in sorted(compared.rows, key=lambda row: -row.expected)}
    stages[leading.candidate.stage] = leading
    order = sorted(stages, key=lambda stage: stages[stage].candidate.rank)
    expected = {stage: stages[stage].expected for stage in order}
    others = [
        _other(stage, row, compared.lost.get(stage, "")) for stage in order if (row := stages[stage]) is not leading
    ]
    costs = [leading.outcomes[name].cost for name in leading.worlds] or [math.inf]
    spread = (
        " " + TEXT("range", low=quantity(min(costs), "m"), high=quantity(max(costs), "m")) if len(costs) > 1 else ""
    )
    led, error = leading.candidate.words, quantity(sum(costs) / len(costs), "m")
    said = [TEXT("why", words=led, error=error, range=spread, others="".join(f", {one}" for one in others))]
    said += [TEXT("broken", n=compared.broken, of=len(leading.outcomes))] if compared.broken else []
    said += [TEXT("barred", stage=stage, why=reason.rstrip(".")) for stage, reason in (barred or {}).items()]
    lacks = {name: quantity(push.force_N, "N") for name, push in worlds.items() if name not in able}
    said += [TEXT("no_world", world=name, force=force, most=quantity(most_N, "N")) for name, force in lacks.items()]
    return Chosen(leading.candidate.stage, leading.candidate.controller, expected, " ".join(said), compared.broken > 0)


def _other(stage: str, row: Row, lost: str) -> str:
    """The worst error found of a stage that does not lead, or where it loses against a plain row."""
    if math.isinf(row.worst):
        return TEXT("other.fails", stage=stage)
    return TEXT("other.loses" if lost else "other.worse", stage=stage, error=quantity(row.worst, "m"), world=lost)
