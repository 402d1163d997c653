"""What leads a run with a model that carries a choice: the stage and the controller, expected to track best."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from controller.choice.choose import ORDER, PLAIN, Candidate, Chosen, Progress, choose
from controller.choice.sight import unfit
from controller.choice.trial import Mission
from controller.choice.world import Localisation, Push
from controller.drives import DRIVES
from controller.model.control_model import ControlModel
from controller.supervision.others import MOST
from hil.app.console import note, progress_bar
from hil.app.scenario.model_use import CHOSEN, TEXT, model_for, motion_beyond, values_of
from hil.app.scenario.scenario import TrackScenario
from models.effects import Catalogue
from models.identification.finding import STAGES
from models.identification.model import CLASS, Model
from models.theta import Theta

NOMINAL: Final = STAGES[0]
SIMPLER: Final = (*STAGES[:2], CLASS)
"""What leads before others that are as good, in turn. Between two models a rig is more likely near their mean."""


class Believed:
    """The control models of a run by values and height of the magnet, each built once."""

    def __init__(self, build: Callable[[Theta, ControlModel | None], ControlModel]) -> None:
        self._build, self._built = build, list[tuple[Theta, float | None, ControlModel]]()

    def __call__(self, values: Theta, before: ControlModel | None = None) -> ControlModel:
        height = None if before is None else _height_m(before)
        for known, asked, model in self._built:
            if height in (asked, _height_m(model)) and known == values:
                return model
        self._built.append((values, height, self._build(values, before)))
        return self._built[-1][-1]


def _height_m(model: ControlModel) -> float:
    return 0.0 if model.rig.magnets is None else model.rig.magnets.height_m


@dataclass(frozen=True)
class Leading:
    """What leads: the `values` of a `stage` and a `controller`, and what was `chosen`, if anything. Where no stage was
    given by hand, `others` may lead on once that model is broken. `beyond` is where the motion leaves the records.
    """

    values: Theta
    stage: str
    controller: str
    chosen: Chosen | None = None
    others: Mapping[str, Theta] = field(default_factory=dict)
    beyond: Mapping[str, Any] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        chosen = {} if self.chosen is None else {"chosen": self.chosen.document()}
        return chosen | {"beyond_records": dict(self.beyond)}

    def seeing(self, mission: Mission, believed: Believed, names: Sequence[str]) -> list[str]:
        """The controllers among `names` that may lead; what was chosen has been asked."""
        if self.chosen is not None and [*names] == [self.controller]:
            return [*names]
        return seeing(mission, believed(self.values), names)

    def beside(self, believed: Believed) -> dict[str, ControlModel]:
        leading = believed(self.values)
        return {stage: believed(values, leading) for stage, values in self.others.items()}


def leading_of(
    path: Path | None,
    stage: str | None,
    controller: str | None,
    scenario: TrackScenario,
    known: Catalogue,
    believed: Believed,
    bar: Callable[[str], AbstractContextManager[Progress]] = progress_bar,
) -> Leading:
    """What leads `scenario` with the model of `path`, if any; `stage` and `controller` given by hand stand."""
    kind, usual = scenario.kind, scenario.control.controller
    model = None if path is None else model_for(path, kind, known)
    beyond = motion_beyond({} if model is None else model.validity, scenario.reference, scenario.duration_s)
    if model is not None and stage in (None, CHOSEN):
        if model.chooses:
            names = names_of(usual, kind, model) if controller is None else [controller]
            with bar(TEXT("choose")) as report:
                return replace(chosen_of(model, believed, mission_of(scenario), names, report), beyond=beyond)
        if stage == CHOSEN:
            raise ValueError(f"{path}: model must carry a choice for --stage chosen, as close-loop writes it; got none")
    values, used = values_of(path, model, stage)
    others = {} if model is None or stage is not None else others_of(model, values)
    return Leading(values, used, usual if controller is None else controller, None, others, beyond)


def names_of(usual: str, kind: str, model: Model) -> list[str]:
    """The controllers that are compared: the `usual` one alone where no world would tell it from others."""
    return [usual] if DRIVES[kind].shaken or not model.possible else list(dict.fromkeys((*ORDER, usual)))


def mission_of(scenario: TrackScenario) -> Mission:
    seen, control = scenario.instruments.localisation, scenario.control
    localisation = Localisation(seen.rate_Hz, seen.std, seen.latency_s, seen.quantum)
    return Mission(scenario.reference, scenario.duration_s, scenario.limits, localisation, control.estimator)


def seeing(mission: Mission, model: ControlModel, names: Sequence[str], tried: Collection[str] = ()) -> list[str]:
    """The controllers among `names` that may lead with the localisation of `mission`; a note on the others. Of those
    `tried` elsewhere no loop is run. Raises ValueError where none may.
    """
    why = {name: unfit(mission, model, name, name not in tried) for name in names}
    able = [name for name in names if not why[name]]
    if not able:
        raise ValueError(why[names[-1]])
    for words in filter(None, why.values()):
        note(words)
    return able


def chosen_of(model: Model, believed: Believed, mission: Mission, names: Sequence[str], report: Progress) -> Leading:
    """The stage or possible model, and the controller among `names`, that lead `mission`."""
    stages = [stage for stage in (*STAGES, *model.members) if stage not in model.barred]
    compared = {*names} - {PLAIN} if len(names) > 1 else ()
    names = seeing(mission, believed(model.believed(NOMINAL)), names, compared)
    candidates, known = list[Candidate](), list[Theta]()
    for stage in stages:
        values = model.believed(stage)
        if any(values == other for other in known):
            continue
        known.append(values)
        leading = believed(values)
        rank = SIMPLER.index(stage) if stage in SIMPLER else len(SIMPLER)
        candidates += [
            Candidate(stage, name, leading, (rank, names.index(name)), stage in model.refuted and name != PLAIN)
            for name in names
            if name != PLAIN or stage == NOMINAL or len(names) == 1
        ]
    numbers = worlds_of(model)
    pushes = {name: Push(**model.unexplained.get(name, {})) for name in numbers}
    found = choose(
        mission, candidates, pushes, lambda name, before: believed(numbers[name], before), report, model.barred
    )
    values = model.believed(found.stage)
    if found.fails:
        seeing(mission, believed(values), [found.controller])
    return Leading(values, found.stage, found.controller, found, others_of(model, values))


def spelled(others: Mapping[str, Theta]) -> dict[str, dict[str, float]]:
    return {stage: values.spelled() for stage, values in others.items()}


def switched(to: Sequence[tuple[float, str]]) -> dict[str, Any]:
    """The key `switched` of a run's JSON object: when which of the other models led on."""
    return {"switched": [{"at_s": at_s, "to": stage} for at_s, stage in to]}


def others_of(model: Model, leading: Theta) -> dict[str, Theta]:
    """The stages and members that may lead in place of the `leading` values, at most `MOST`, the last stage first."""
    found: dict[str, Theta] = {}
    for stage in (*reversed(STAGES), *model.members):
        values = model.believed(stage)
        if stage not in model.barred and values != leading and values not in found.values():
            found[stage] = values
    return dict(list(found.items())[:MOST])


def worlds_of(model: Model) -> dict[str, Theta]:
    """The models that the records leave possible, the last stage first, equal ones once, no mean of a class."""
    names = [name for name in (*reversed(STAGES), *model.possible) if name not in (*model.refuted, CLASS)]
    found: dict[str, Theta] = {}
    for name in names:
        values = model.possible[name] if name in model.possible else model.stages[name]
        if values not in found.values():
            found[name] = values
    return found
