"""Both controllers, in Python and in C, on the same readings of one plant."""

from dataclasses import dataclass

import numpy as np
import pytest

from controller.drives import envelope_of
from controller.model.control_model import ControlModel
from controller.reference import Trajectory
from controller.registry import build, estimator_for
from controller.signals import Array, Estimate, Measurement
from controller.step.compiled import CompiledSupervisor, supervisor_of
from controller.step.library import available
from controller.supervision.supervisor import Supervisor
from plant.rig import Truth
from plant.session import Session

needs_compiler = pytest.mark.skipif(not available(), reason="no C compiler, or no sources of DAQP ('make setup')")


@dataclass
class Both:
    """A run of n ticks led by Python: commands (n, 2), estimates, statuses, each of Python and of C."""

    commands: Array
    estimates: list[tuple[Estimate, Estimate]]
    statuses: list[tuple[str, str]]
    supervisors: tuple[Supervisor, Supervisor]


def both(model: ControlModel, controller: str, truth: Truth, reference: Trajectory, ticks: int, cut: int = -1) -> Both:
    """The loop; from the tick `cut` on nothing is measured."""
    envelope = envelope_of(model.drive)
    python = Supervisor(build(controller, model, envelope), envelope)
    in_c = supervisor_of(controller, model, envelope)
    assert isinstance(in_c, CompiledSupervisor)
    filters = estimator_for(controller, model), in_c.observer_for(controller, model, "default")
    session = Session(truth, seed=3)
    commands, estimates, statuses = np.zeros((ticks, 2)), [], []
    arrived: list[Measurement] = []
    for k in range(ticks):
        now = k * model.tick_s
        first, second = (one.observe(now, python.issued.command, arrived) for one in filters)
        answers = [one.act(now, first, reference) for one in (python, in_c)]
        commands[k] = [answer.command for answer in answers]
        estimates.append((first, second))
        statuses.append((answers[0].status, answers[1].status))
        readings = session.advance(answers[0].command, now + model.tick_s)
        arrived = [Measurement(r.channel, r.value, r.stamp_s) for r in readings] if not 0 <= cut <= k else []
    return Both(commands, estimates, statuses, (python, in_c))
