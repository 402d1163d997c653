"""Control with a learned model against nominal and PID, in simulation, before it is offered."""

from dataclasses import dataclass
from typing import Final

from controller.choice.choose import ORDER, PLAIN, Candidate, Chosen, choose
from controller.choice.trial import Mission
from controller.choice.world import Push
from controller.model.control_model import ControlModel, control_model
from controller.registry import CONTROLLERS
from hil.app.scenario.chosen import NOMINAL
from models.identification.model import CLASS, Model
from models.rigs.rig import Rig

WORLDS: Final = 3
"""Models that the records leave possible in which a learned one is tried: three loops each, a second of processor."""


@dataclass(frozen=True)
class Led:
    """What a learned model is to lead: a `mission` with the `controller` of that name, in ticks of `tick_s`. The
    process that learns does not know a user's own controllers: there the simplest of the others stands for one.
    """

    mission: Mission
    controller: str
    tick_s: float


def compared(led: Led, rig: Rig, model: Model, stage: str) -> Chosen:
    """What tracks best: the `stage` of the learned `model`, or its nominal stage with the same controller or a PID."""
    rivals = [name for name in model.possible if name != CLASS and name not in model.refuted]
    built: dict[str, ControlModel] = {}
    for name in (NOMINAL, stage, *rivals[: WORLDS - 1]):
        built[name] = control_model(rig, model.believed(name), led.tick_s)
    leads = led.controller if led.controller in CONTROLLERS else ORDER[0]
    plain = [Candidate(NOMINAL, name, built[NOMINAL], (0, k)) for k, name in enumerate({leads: 0, PLAIN: 0})]

    candidates = [*plain, Candidate(stage, leads, built[stage], (1, 0))]
    pushes = {name: Push(**model.unexplained.get(name, {})) for name in [*built][1:]}
    return choose(led.mission, candidates, pushes, lambda name, _: built[name], lambda *_: None)
