"""The model and the controller that lead: those whose worst error over all possible models is least."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from controller.choice.trial import Mission, Outcome, tried
from controller.choice.world import Possible
from controller.drives import envelope_of
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
    """The outcomes of a candidate by world, of `count` worlds."""

    candidate: Candidate
    count: int
    outcomes: dict[str, Outcome] = field(default_factory=dict)

    @property
    def worst(self) -> float:
        return max((one.cost for one in self.outcomes.values()), default=0.0)

    @property
    def whole(self) -> bool:
        return len(self.outcomes) == self.count and all(one.whole for one in self.outcomes.values())

    @property
    def expected(self) -> float:
        """The mean over the worlds that were tried to the end, where there are any: others give a bound from below."""
        tried = self.outcomes.values()
        costs = [one.cost for one in tried if one.whole] or [one.cost for one in tried]
        return sum(costs) / max(len(costs), 1)


@dataclass(frozen=True)
class Chosen:
    """What leads: `stage` with `controller`; the error in m that is `expected` of each stage with its best controller,
    the mean over the models it was tried in, and `why` in words.
    """

    stage: str
    controller: str
    expected: Mapping[str, float]
    why: str

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
        worlds: Sequence[str],
        world: Callable[[str, ControlModel], Possible],
        report: Progress,
    ) -> None:
        """`world` gives the model that is the world of that name, for a rig as the leading model has it."""
        self._mission, self._piece, self._world, self._report = mission, mission.piece(), world, report
        self._worlds = list(worlds)
        self.rows = [Row(one, len(worlds)) for one in candidates]
        self.runs = 0
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
        """The row that leads: the least worst of those that lose against no plain one; of all where only a model that
        the records refute is left; the simplest where all break a limit.
        """
        plain = [row for row in self.rows if row.candidate.plain]
        self._try([(row, self._worlds[0]) for row in plain])
        most_m = HOPELESS * min((row.worst for row in plain), default=math.inf)
        self._try([(row, self._worlds[0]) for row in self.rows if row not in plain], most_m)
        left, losing = list(self.rows), list[Row]()
        while left and (leading := self._least_worst(left, self._bearable_by_all() if losing else {})):
            lost = "" if leading in plain else next(filter(None, (self._loses(leading, row) for row in plain)), "")
            if not lost:
                return losing[0] if losing and leading.candidate.refuted else leading
            losing.append(leading)
            self.lost.setdefault(leading.candidate.stage, lost)
            left.remove(leading)
        return min(self.rows, key=lambda row: row.candidate.rank)

    def _least_worst(self, rows: Sequence[Row], most: Mapping[str, float]) -> Row | None:
        """The row of least worst error, of those equal within `TIE` the simplest; None where all break a limit. A row
        that is not plain has lost where its error in a world is above `most`: there it is tried first, and given up.
        """
        least = min((row.worst for row in rows if row.whole and not self._behind(row, most)), default=math.inf)
        for row in sorted(rows, key=lambda row: row.worst):
            own = {} if row.candidate.plain else most
            while not row.whole and row.worst <= TIE * least and not self._behind(row, most):
                tried = sorted(self._missing(row), key=lambda name: own.get(name, math.inf))[: cores()]
                most_m = max(own.get(name, math.inf) for name in tried)
                self._try([(row, name) for name in tried], min(TIE * least, most_m))
            if row.whole and not self._behind(row, most):
                least = min(least, row.worst)
        equal = [row for row in rows if row.whole and row.worst <= TIE * least < math.inf]
        return min((row for row in equal if not self._behind(row, most)), key=lambda r: r.candidate.rank, default=None)

    def _missing(self, row: Row) -> list[str]:
        """The worlds in which `row` was not tried to the end."""
        return [name for name in self._worlds if name not in row.outcomes or not row.outcomes[name].whole]

    def _behind(self, row: Row, most: Mapping[str, float]) -> bool:
        """Whether a row that is not plain has an error above `most` in a world, which is noted."""
        found = () if row.candidate.plain else row.outcomes.items()
        lost = next((name for name, one in found if one.cost > most.get(name, math.inf)), "")
        if lost:
            self.lost.setdefault(row.candidate.stage, lost)
        return bool(lost)

    def _bearable_by_all(self) -> dict[str, float]:
        """The error in m by world above which a row loses against a plain one that was tried in all of them."""
        known = [row for row in self.rows if row.candidate.plain and row.whole and row.worst < math.inf]
        return {
            name: min((row.outcomes[name].cost + (TIE - 1) * row.worst for row in known), default=math.inf)
            for name in self._worlds
        }

    def _loses(self, leading: Row, plain: Row) -> str:
        """The first world in which the error of `leading` is above that of the `plain` row by more than the share `TIE`
        of the worst that the plain one risks, or "". The plain row is tried no longer than until it is the worse one,
        but everywhere before it counts: one that breaks a limit somewhere is no better choice.
        """
        for name in self._worlds:
            known, most_m = plain.outcomes.get(name), self._bearable(leading, plain, name)
            if known is None or not (known.whole or known.cost >= most_m):
                self._try([(plain, name)], most_m)
            if plain.outcomes[name].whole and plain.outcomes[name].cost < most_m:
                self._try([(plain, other) for other in self._missing(plain)])
                if plain.outcomes[name].cost < self._bearable(leading, plain, name):
                    return name
        return ""

    def _bearable(self, leading: Row, plain: Row, name: str) -> float:
        """The error of the `plain` row in m below which `leading` loses in a world."""
        return leading.outcomes[name].cost - (TIE - 1) * plain.worst


def choose(
    mission: Mission,
    candidates: Sequence[Candidate],
    worlds: Sequence[str],
    world: Callable[[str, ControlModel], Possible],
    report: Progress,
    barred: Mapping[str, str] | None = None,
) -> Chosen:
    """The candidate that leads on `mission`, and why; `worlds` are the possible models, the likeliest first. `barred`
    says why other stages are no candidates.
    """
    compared = Comparison(mission, candidates, worlds, world, report)
    leading = compared.best()
    stages = {row.candidate.stage: row for row in sorted(compared.rows, key=lambda row: -row.expected)}
    stages[leading.candidate.stage] = leading
    order = sorted(stages, key=lambda stage: stages[stage].candidate.rank)
    expected = {stage: stages[stage].expected for stage in order}
    others = [
        _other(stage, row, compared.lost.get(stage, "")) for stage in order if (row := stages[stage]) is not leading
    ]
    costs = [one.cost for one in leading.outcomes.values()]
    spread = (
        " " + TEXT("range", low=quantity(min(costs), "m"), high=quantity(max(costs), "m")) if len(costs) > 1 else ""
    )
    led, error = leading.candidate.words, quantity(leading.expected, "m")
    why = TEXT("why", words=led, error=error, range=spread, others="".join(f", {one}" for one in others))
    said = [why, *(TEXT("barred", stage=stage, why=reason) for stage, reason in (barred or {}).items())]
    return Chosen(leading.candidate.stage, leading.candidate.controller, expected, " ".join(said))


def _other(stage: str, row: Row, lost: str) -> str:
    """The worst error found of a stage that does not lead, or where it loses against a plain row."""
    if math.isinf(row.worst):
        return TEXT("other.fails", stage=stage)
    return TEXT("other.loses" if lost else "other.worse", stage=stage, error=quantity(row.worst, "m"), world=lost)
