"""The controllers by name, own ones of a user or package included: the chain for the supervisor, best first."""

import inspect
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

from controller.baselines import LQR, PID
from controller.drives import DRIVES, INNER_MASS, driven_of
from controller.estimator.base import Observer, trusting
from controller.estimator.cubature import CubatureEstimator
from controller.estimator.kinematic_filter import KinematicFilter
from controller.estimator.particle_filter import ParticleEstimator
from controller.feedforward import Feedforward
from controller.limits import Envelope, Limits
from controller.model.control_model import AT_FIRST, ControlModel, level_off, mean_friction
from controller.mpc.mpc import MPC
from controller.signals import Controller
from controller.tuned import FilterNoise, Horizon
from controller.vibro.controller import vibro_controller
from models.files.python_file import classes_in, installed
from models.files.toml import check_word

GROUP: Final = "capsule.controllers"


def _declared(paths: Sequence[Path]) -> Iterator[tuple[str, type[Controller]]]:
    for where, cls, _ in installed(GROUP, "controllers"):
        yield where, cls
    for path in paths:
        classes = [c for c in classes_in(path, "controllers")[0] if Controller in c.__mro__]
        if not classes:
            raise ValueError(f"{path}: file must have a subclass of controller.signals.Controller; got none")
        yield from ((str(path), cls) for cls in classes)


def _failure(cls: type[Controller], taken: Collection[str]) -> str | None:
    name, kinds = getattr(cls, "name", ""), getattr(cls, "kinds", ())
    if not isinstance(name, str) or not name.isidentifier():
        return f"{cls.__name__}.name must be letters, digits and underscores; got {name!r}"
    if name in taken:
        return f"{cls.__name__}.name must be one that is free; got {name!r}"
    if not isinstance(kinds, tuple) or not kinds or not set(kinds) <= set(DRIVES):
        return f"{cls.__name__}.kinds must be some of {', '.join(DRIVES)} in a tuple; got {kinds!r}"
    if list(inspect.signature(cls).parameters) != ["model", "envelope"]:
        return f"{cls.__name__} must be made from (model, envelope); got {inspect.signature(cls)}"
    wanted = list(inspect.signature(Controller.act).parameters)
    got = list(inspect.signature(cls.act).parameters)
    return None if got == wanted else f"{cls.__name__}.act must take ({', '.join(wanted)}); got ({', '.join(got)})"


LATE_SLIP, _LEAST_LATE = 0.25, 0.05
"""Share of its limit by which slip may come later than the model predicts; the lesser share for a proved model. Of 0 to
0.5, those from 0.15 to 0.3 tracked best on ramp and sine in a straight tube and in random guts, seeds from 100 on. With
augmented models (fading grip, drag, drying) 0.05 did.
"""
HOLD_S = 0.01
"""A period of the localisation. Of 0, 10 and 20 ms the latter two tracked alike, and no worse than 0, on ramp, sine,
folds and a coil's steps, seeds from 100 on; a plan per tick takes three times as long.
"""
ITERATIONS = 2
"""SQP steps of a plan, which continues in the next tick if it still gains. Two tracked as well as three in guts, on
ramp and steps, over folds and under pushes, seeds from 100 on; the longest plan takes two thirds of the time.
"""
MPC_PUSH_N = 40e-3
"""Random walk of a push for the estimator before a magnet's MPC, in N per root second, in place of 60 mN. With an
unmodelled lag of 0.1 to 0.15 s an MPC answers the pushes that it causes itself and hunts by 2 mm: in five of eight
runs, with 40 mN in one. 30 mN cost more under true pushes; seeds from 100 on.
"""
ESTIMATORS = ("default", "ukf")
"""The estimators of a scenario or deployment: the default of the controller, or filterpy's."""
Chain = tuple[Controller, ...]
Builder = Callable[[ControlModel, Envelope, float], Chain]


def horizon_of(model: ControlModel, deadline_s: float = math.inf, short: bool = False) -> Horizon:
    """The horizon of `model`'s MPC; `short`: as long, with fewer stages and one SQP step, for a microcontroller."""
    off = level_off(model)
    late = LATE_SLIP if off is None else min(LATE_SLIP, _LEAST_LATE + AT_FIRST * off)
    found = Horizon(iterations=ITERATIONS, deadline_s=deadline_s, late_slip=late, hold_s=HOLD_S)
    return replace(found, stages=20, stage_s=7.5e-3, iterations=1) if short else found


def _mpc(model: ControlModel, envelope: Envelope, deadline_s: float) -> Chain:
    first = MPC(model, envelope, horizon=horizon_of(model, deadline_s))
    return (first, Feedforward(model, envelope), PID(model, envelope))


SHAKING: Mapping[str, Builder] = {
    INNER_MASS.leading: lambda model, envelope, _: (vibro_controller(model),),
    "vibro_square": lambda model, envelope, _: (vibro_controller(model, optimise=False),),
    "vibro_map": lambda model, envelope, _: (vibro_controller(model, feedback=False),),
}
_OWN: dict[str, type[Controller]] = {}
_BUILDERS: dict[str, Builder] = {
    "pid": lambda model, envelope, _: (PID(model, envelope, driven_of(model.drive).pid),),
    "pid_friction": lambda model, envelope, _: (
        PID(model, envelope, driven_of(model.drive).pid_friction, mean_friction(model)),
    ),
    "pid_estimated": lambda model, envelope, _: (PID(model, envelope),),
    "pid_friction_estimated": lambda model, envelope, _: (PID(model, envelope, friction_N=mean_friction(model)),),
    "lqr": lambda model, envelope, _: (LQR(model, envelope), PID(model, envelope)),
    "feedforward": lambda model, envelope, _: (Feedforward(model, envelope), PID(model, envelope)),
    "mpc": _mpc,
    **SHAKING,
}
CONTROLLERS: Mapping[str, Builder] = MappingProxyType(_BUILDERS)
"""`pid` and `pid_friction` use a kinematic filter, as in a laboratory without a friction model; all others, the two
PIDs named estimated included, the friction-aware estimate. `vibro_square` is `vibro` with square waves alone,
`vibro_map` without its slow loop.
"""


MODEL_FREE: Final = ("pid", "pid_friction")  # Controllers on the kinematic filter, which nothing carries across a delay


def leads(name: str) -> tuple[str, ...]:
    """The kinds of drive that the controller `name` can control."""
    if name in _OWN:
        return tuple(getattr(_OWN[name], "kinds", ()))
    return tuple(kind for kind, driven in DRIVES.items() if driven.shaken == (name in SHAKING))


def use_controllers(paths: Sequence[Path]) -> None:
    """Make the controllers of the files `paths` and of installed packages available by name, in place of those of an
    earlier call; a PID is the fallback of one that moves a body. Raises ValueError, one sentence with the file, and
    adds none, if one cannot be used.
    """
    for name in _OWN:
        del _BUILDERS[name]
    _OWN.clear()
    found: dict[str, type[Controller]] = {}
    for where, cls in _declared(paths):
        failure = _failure(cls, {*CONTROLLERS, *found})
        if failure is not None:
            raise ValueError(f"{where}: {failure}")
        found[cls.name] = cls
    for name, cls in found.items():
        _OWN[name], _BUILDERS[name] = cls, _own(cls)


def _own(cls: type[Controller]) -> Builder:
    def chain(model: ControlModel, envelope: Envelope, deadline_s: float) -> Chain:
        try:
            first = cls(model, envelope)  # type: ignore[call-arg]
        except Exception as error:  # noqa: BLE001 - a user's class may raise anything
            got = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
            raise ValueError(f"controller {cls.__name__} must be one that can be made; got {got}") from None
        return (first, PID(model, envelope)) if not envelope.shaken else (first,)

    return chain


def noise_of(name: str, model: ControlModel, age_s: float) -> FilterNoise:
    """The noise of the estimator before the controller `name`, with positions up to `age_s` old."""
    noise = trusting(model).up_to(age_s)
    pushed = name == "mpc" and driven_of(model.drive).placed
    return replace(noise, push_wander_N=MPC_PUSH_N) if pushed else noise


def estimator_for(name: str, model: ControlModel, estimator: str = "default", age_s: float = Limits.age_s) -> Observer:
    """The estimator of the controller `name` for measurements up to `age_s` old, unless `estimator` is another."""
    driven = driven_of(model.drive)
    classical = dict(zip(MODEL_FREE, (driven.pid, driven.pid_friction), strict=True)).get(name)
    if estimator == "default" and classical is not None:
        return KinematicFilter(model, classical.jerkiness, FilterNoise().up_to(age_s))
    sharp = model.sharp
    noise = trusting(sharp).up_to(age_s)
    if estimator == "ukf":
        from controller.estimator.ukf import UnscentedEstimator  # filterpy loads half of SciPy

        return UnscentedEstimator(sharp, noise)
    if driven.shaken and age_s > Limits.age_s:  # after old readings particles of a shaken capsule lose their level
        return CubatureEstimator(sharp, noise)
    return ParticleEstimator(sharp, noise_of(name, sharp, age_s))


def build(name: str, model: ControlModel, envelope: Envelope, deadline_s: float = math.inf) -> Chain:
    """The controller `name` for `model` within `envelope`, with its fallbacks; `deadline_s` is the MPC's. Raises
    ValueError for an unknown name, with the nearest one, and for a drive that it cannot control.
    """
    check_word(name, "controller", CONTROLLERS)
    if model.drive.name not in leads(name):
        raise ValueError(
            f"rig must be {' or '.join(leads(name))} for the controller {name!r}; got {model.drive.name!r}"
        )
    return CONTROLLERS[name](model, envelope, deadline_s)
