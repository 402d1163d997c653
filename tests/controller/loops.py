"""Small closed loops and rigs for the controller's tests. The truth here is the control model's own or the plant's."""

from collections.abc import Sequence

import numpy as np

from controller.drives import DRIVES, envelope_of
from controller.estimator.cubature import CubatureEstimator
from controller.model.control_model import ControlModel, control_model
from controller.model.kernels import Kernels
from controller.signals import Array, Controller, Measurement, Reference
from controller.supervision.supervisor import Supervisor
from hil.app.scenario.scenario import parse_track_scenario
from models.rigs.rig import Rig
from models.theta import Theta
from plant.rig import Truth
from plant.session import Instruments, Session


def believed(kind: str = "magnetic") -> Rig:
    """What an experimenter believes of a nominal rig."""
    drive = {} if kind == "magnetic" else {"drive": {"gain_N_per_A": 0.5}}
    return parse_track_scenario({"rig": {"kind": kind}, "reference": {"kind": "hold"}, **drive}).belief


def model_of(kind: str = "magnetic", tick_s: float = 1e-3) -> ControlModel:
    """The control model of a nominal rig."""
    return control_model(believed(kind), Theta(), tick_s, driven=DRIVES[kind].simulated)


def ticked(kernels: Kernels, x: Array, command: float, disturbance_N: float, t: float) -> Array:
    """The state (n,) a tick after `x` under a held `command`."""
    states = np.array(x, dtype=float).reshape(1, -1)
    motion = (t, kernels.tick_s, kernels.substeps, kernels.parameters)
    kernels.run(states, command, command, np.array([disturbance_N]), *motion)
    return np.asarray(states[0])


def closed_loop(
    model: ControlModel,
    chain: Sequence[Controller],
    reference: Reference,
    duration_s: float,
    truth: Truth,
    estimator: CubatureEstimator,
    instruments: Instruments | None = None,
    seed: int = 0,
) -> tuple[Array, Array, list[str], Array]:
    """Rows of the truth, commands, statuses and estimated positions, a tick each but the rows."""
    supervisor = Supervisor(chain, envelope_of(model.drive))
    session = Session(truth, instruments, seed)
    arrived: list[Measurement] = []
    commands, statuses, places = [], [], []
    for k in range(round(duration_s / model.tick_s)):
        now = k * model.tick_s
        estimate = estimator.observe(now, supervisor.issued.command, arrived)
        action = supervisor.act(now, estimate, reference)
        commands.append(action.command)
        statuses.append(action.status)
        places.append(estimate.state[0])
        arrived = [
            Measurement(r.channel, r.value, r.stamp_s) for r in session.advance(action.command, now + model.tick_s)
        ]
    return np.concatenate(session.rows), np.array(commands), statuses, np.array(places)
