"""The controllers by name: each name's chain for the supervisor, best first."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from controller.baselines.lqr import LQR
from controller.baselines.pid import PID, mean_friction
from controller.feedforward import Feedforward
from controller.limits import Envelope
from controller.mpc.mpc import MPC
from controller.mpc.settings import Bounds
from controller.prediction import ControlModel
from controller.signals import Controller
from controller.vibro.leading import vibro_controller
from models.parameter import nearest

Chain = tuple[Controller, ...]
Builder = Callable[[ControlModel, Envelope], Chain]


def _pid(model: ControlModel, envelope: Envelope) -> Chain:
    return (PID(model, envelope),)


def _pid_friction(model: ControlModel, envelope: Envelope) -> Chain:
    return (PID(model, envelope, friction_N=mean_friction(model)),)


def _feedforward(model: ControlModel, envelope: Envelope) -> Chain:
    return (Feedforward(model, envelope), PID(model, envelope))


def _lqr(model: ControlModel, envelope: Envelope) -> Chain:
    return (LQR(model, envelope), PID(model, envelope))


def _mpc(model: ControlModel, envelope: Envelope) -> Chain:
    return (MPC(model, Bounds.of(envelope)), Feedforward(model, envelope), PID(model, envelope))


def _vibro(model: ControlModel, envelope: Envelope) -> Chain:
    return (vibro_controller(model),)


CONTROLLERS: Mapping[str, Builder] = MappingProxyType(
    {"pid": _pid, "pid_friction": _pid_friction, "lqr": _lqr, "feedforward": _feedforward, "mpc": _mpc, "vibro": _vibro}
)
_BODY = ("magnetic", "coil")


def leads(name: str) -> tuple[str, ...]:
    """The kinds of drive that the controller `name` can lead."""
    return ("vibro",) if name == "vibro" else _BODY


def build(name: str, model: ControlModel, envelope: Envelope) -> Chain:
    """The controller `name` for `model` within `envelope`, with those that step in for it.

    Raises ValueError for an unknown name, naming the nearest, and for a drive that these controllers cannot lead.
    """
    if name not in CONTROLLERS:
        raise ValueError(f"controller must be one of {', '.join(CONTROLLERS)}; got {name!r}; {nearest(name, CONTROLLERS)}")
    if model.drive.name not in leads(name):
        raise ValueError(f"rig must be {' or '.join(leads(name))} for the controller {name!r}; got {model.drive.name!r}")
    return CONTROLLERS[name](model, envelope)
