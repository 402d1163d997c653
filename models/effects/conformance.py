"""What every effect must keep to, ours and a user's: declared parameters, hooks with the right signatures that serve
numbers and CasADi symbols alike, and that say nothing at amplitude zero.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping
from typing import Any, Final

import casadi as ca
import numpy as np

from models.effects.effect import Effect, InnerMassEffect, Signals
from models.effects.equation import disagreement
from models.rigs.kinds import KINDS

SIGNALS: Final[Mapping[str, float]] = {
    "t": 0.7,
    "x": 4e-3,
    "v": 6e-3,
    "direction": 1.0,
    "command": 0.4,
    "rate": -0.2,
    "travelled": 0.02,
    "tension": 0.02,
    "drag": 2e-4,
    "drag_rate": 3e-3,
    "dwell": 0.3,
    "load": 1.5,
}
"""Values of the signals, SI, at which the hooks are tried."""
MULTIPLIERS: Final = ("level", "stiffening", "gain")
_PLAIN: Final = (*MULTIPLIERS, "force", "wall_force", "command")
_STATE: Final = 0.2


def first_failure(effect: type[Effect], known: Collection[str]) -> str | None:
    """The first rule that `effect` breaks, in a sentence; None where it keeps to all. `known` are the ids in use."""
    for check in CHECKS.values():
        try:
            failure = check(effect, known)
        except Exception as error:  # noqa: BLE001 - a user's hook raises whatever it likes
            words = " ".join(str(error).split())[:160]
            return f"{effect.__name__} must run; got {type(error).__name__} in '{check.__doc__}': {words}"
        if failure is not None:
            return failure
    return None


def values_of(effect: type[Effect]) -> dict[str, float]:
    """The parameters at their defaults, the amplitude at its probe."""
    return {p.name: p.value for p in effect.parameters()} | {effect.amplitude().name: effect.probe}


def answers(effect: type[Effect], p: Mapping[str, Any], z: Mapping[str, Any], s: Mapping[str, Any]) -> dict[str, Any]:
    """What every hook says at parameters `p`, states `z` and signals `s`."""
    e, signals = effect(), Signals(**s)
    said = {hook: getattr(e, hook)(signals, p, z) for hook in _PLAIN}
    said |= {"recovery": e.recovery(signals, p, z, 5e-3, 3e-4), "measured": e.measured(signals, p, z, 0.03)}
    said |= {"delay": e.delay(p), "response": e.response(p)}
    said |= {f"advance.{k}": v for k, v in e.advance(signals, p, z, 1e-3).items()}
    said |= {f"follow.{k}": v for k, v in e.follow(signals, p, z, 0.03, 1e-3).items()}
    if isinstance(e, InnerMassEffect):
        said |= {"suspension": e.suspension(0.012, 0.1, p), "reach": e.reach(0.012, p)}
    return said


def _declared(effect: type[Effect], known: Collection[str]) -> str | None:
    """declarations"""
    name = effect.__name__
    if not isinstance(effect.id, str) or not effect.id.isidentifier() or effect.id != effect.id.lower():
        return f"{name}.id must be lower-case letters, digits and underscores; got {effect.id!r}"
    if not effect.summary:
        return f"{name}.summary must say in a few words what the effect is; got none"
    if not effect.kinds or not effect.kinds <= set(KINDS):
        return f"{name}.kinds must be among {', '.join(KINDS)}; got {sorted(effect.kinds)}"
    strange = sorted(set(effect.confounders) - set(known))
    return f"{name}.confounders must be ids of known effects; got {strange[0]!r}" if strange else None


def _parameters(effect: type[Effect], known: Collection[str]) -> str | None:
    """parameters"""
    name, parameters = effect.__name__, effect.parameters()
    if not parameters:
        return f"{name} must have a parameter, its amplitude first; got none"
    loose = next((p for p in parameters if not np.isfinite([p.lower, p.upper]).all() or p.lower >= p.upper), None)
    if loose is not None:
        return (
            f"{name}.{loose.name} must have finite bounds, the lower below the upper; got {loose.lower}, {loose.upper}"
        )
    amplitude = effect.amplitude()
    if amplitude.value != 0.0 or not amplitude.fit:
        return f"{name}.{amplitude.name}, the amplitude, must start at 0 and be fitted; got {amplitude.value:g}"
    if effect.probe == 0 or not amplitude.lower <= effect.probe <= amplitude.upper:
        return f"{name}.probe must be an amplitude within its bounds and not 0; got {effect.probe:g}"
    names = [p.name for p in parameters]
    unknown = next((grid for grid in effect.grid if grid not in names), None)
    return f"{name}.grid must name parameters; got {unknown!r}" if unknown is not None else None


def _signatures(effect: type[Effect], known: Collection[str]) -> str | None:
    """signatures"""
    base = InnerMassEffect if issubclass(effect, InnerMassEffect) else Effect
    for hook, ours in inspect.getmembers(base, inspect.isfunction):
        if hook.startswith("_") or getattr(effect, hook) is ours:
            continue
        wanted, got = (list(inspect.signature(f).parameters) for f in (ours, getattr(effect, hook)))
        if wanted != got:
            return f"{effect.__name__}.{hook} must take ({', '.join(wanted)}); got ({', '.join(got)})"
    return None


def _symbols(effect: type[Effect], known: Collection[str]) -> str | None:
    """numbers and CasADi symbols"""
    p, z = values_of(effect), dict.fromkeys(effect.states, _STATE)
    plain = answers(effect, p, z, SIGNALS)
    symbols = [{name: ca.SX.sym(name) for name in table} for table in (p, z, SIGNALS)]
    try:
        symbolic = {hook: ca.SX(value) for hook, value in answers(effect, *symbols).items()}
    except Exception as error:  # noqa: BLE001 - whatever a branch on a symbol raises
        words = " ".join(str(error).split())[:160]
        return (
            f"{effect.__name__} must trace to CasADi symbols (np.where, np.tanh, ... instead of if, math); got: {words}"
        )
    evaluate = ca.Function("f", [s for table in symbols for s in table.values()], list(symbolic.values()))
    got = evaluate.call([value for table in (p, z, SIGNALS) for value in table.values()])
    for hook, value in zip(symbolic, got, strict=True):
        if not np.isclose(float(value), float(plain[hook]), rtol=1e-10, atol=1e-15):
            return (
                f"{effect.__name__}.{hook} must say the same to symbols as to numbers; got {float(value):g} and"
                f" {float(plain[hook]):g}"
            )
    return None


def _silent(effect: type[Effect], known: Collection[str]) -> str | None:
    """amplitude zero"""
    p = values_of(effect) | {effect.amplitude().name: 0.0}
    z: dict[str, Any] = dict.fromkeys(effect.states, _STATE)
    e, s = effect(), Signals(**SIGNALS)
    z = z | e.advance(s, p, z, 1e-3) | e.follow(s, p, z, 0.03, 1e-3)
    silence = {"level": 1.0, "stiffening": 1.0, "gain": 1.0, "force": 0.0, "wall_force": 0.0, "delay": 0.0}
    silence["normal_load"] = 0.0
    silence |= {"command": SIGNALS["command"], "measured": 0.03, "recovery": 5e-3, "suspension": 0.0, "reach": 1.0}
    for hook, value in answers(effect, p, z, SIGNALS).items():
        if hook in silence and not np.isclose(float(value), silence[hook], rtol=1e-6, atol=0.0):
            return (
                f"{effect.__name__}.{hook} must be {silence[hook]:g} (no effect) where {effect.amplitude().name} is 0;"
                f" got {float(value):g}"
            )
    return None


def _finite(effect: type[Effect], known: Collection[str]) -> str | None:
    """states over steps of a second"""
    rng = np.random.default_rng(7)
    e, p = effect(), {q.name: q.value for q in effect.parameters()}
    for amplitude in (effect.probe, effect.amplitude().lower, effect.amplitude().upper):
        p[effect.amplitude().name] = amplitude
        z: dict[str, Any] = dict.fromkeys(effect.states, 0.0)
        for k in range(300):
            v, command, rate, x, y = rng.normal(size=5) * (0.02, 1.0, 1.0, 0.02, 1.0)
            s = Signals(t=float(k), v=v, command=command, rate=rate, x=x)
            z = z | e.advance(s, p, z, 1.0)
            z = z | e.follow(s, p, z, y, 1.0)
        unbounded = next((name for name, value in z.items() if not abs(float(value)) < 10.0), None)
        if unbounded is not None:
            got = float(z[unbounded])
            return f"{effect.__name__}'s state {unbounded!r} must stay bounded with steps of 1 s; got {got:g}"
    return None


def _printed(effect: type[Effect], known: Collection[str]) -> str | None:
    """printed equations"""
    for seed in range(4):
        failure = disagreement(effect, np.random.default_rng(seed))
        if failure is not None:
            return f"{effect.__name__} must compute what its equations say; got {failure}"
    return None


CHECKS: Final[Mapping[str, Callable[[type[Effect], Collection[str]], str | None]]] = {
    "declared": _declared,
    "parameters": _parameters,
    "signatures": _signatures,
    "symbols": _symbols,
    "silent_at_zero": _silent,
    "bounded_states": _finite,
    "equations": _printed,
}
