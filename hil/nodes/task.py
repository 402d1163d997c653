"""What a controller node is built from, and its estimator and supervised controllers."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from controller.limits import Envelope, Limits
from controller.model.control_model import ControlModel
from controller.reference import Experiment
from controller.signals import Reference
from controller.step.compiled import supervisor_of
from controller.supervision.model_switch import ModelSwitch, Offer
from controller.supervision.supervisor import Supervisor
from hil.nodes.operator import OperatorLimits


@dataclass(frozen=True)
class Task:
    """What a controller node is built from: model, name of a controller in `controller.registry`, reference, limits;
    noise `seen_noise_m` and `resolution_m` of the localisation; `deadline_s` of the MPC's plan within a tick (inf: no
    deadline); an `offer` that takes over while the capsule rests; `others` that lead on once the model is broken; an
    `estimator` of `ESTIMATORS`; the models `learned`
    and the `experiments` of a run that is replayed; the limits of an `operator`; whether a `probe` comes first, and
    whether the controller runs in C where that is `available`.
    """

    model: ControlModel
    controller: str
    reference: Reference
    limits: Limits
    seen_noise_m: float = 5e-4
    deadline_s: float = math.inf
    resolution_m: float = 0.0
    offer: Offer | None = None
    others: Mapping[str, ControlModel] = field(default_factory=dict)
    estimator: str = "default"
    learned: tuple[Offer, ...] = ()
    experiments: tuple[Experiment, ...] = ()
    operator: OperatorLimits | None = None
    probe: bool = False
    in_c: bool = True

    def built(self, envelope: Envelope) -> tuple[Supervisor, ModelSwitch]:
        """The supervised controllers within `envelope`, and the estimator. Raises ValueError where they do not fit."""
        supervisor = supervisor_of(self.controller, self.model, envelope, self.deadline_s, self.in_c)
        asked = self.controller, self.model, self.offer, self.deadline_s, self.estimator, self.others
        estimator = ModelSwitch(supervisor, *asked)
        for offer in self.learned:
            estimator.propose(offer)
        return supervisor, estimator
