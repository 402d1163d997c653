"""The rules for every effect, ours and a user's: declarations that something reads; hooks of the right signature that
each of its kinds of rig calls, that work for numbers, arrays and CasADi symbols, and that change nothing at amplitude
zero.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import fields
from inspect import getsourcefile
from itertools import product
from traceback import extract_tb
from typing import Any, Final

import casadi as ca
import numpy as np

from models.effects.declarations import declared, hooked, of_parameters
from models.effects.effect import HOOKS, Effect, Signals
from models.effects.equation import LEFT, SIDES, SIGNALS, TRIED, USUAL, Symbols, answered, names_in, own_forms, traced
from models.formula import value_of
from models.parameter import nearest
from models.rigs.benches import DRIVEN_AXIS
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS

_BODY: Final = frozenset(HOOKS) - {"suspension", "reach", "link", "gain", "modulus", "direction"}
_MOVING: Final = frozenset(f.name for f in fields(Signals)) - {"load", "loads"}


def hooks_of(kind: RigKind) -> frozenset[str]:
    """The hooks that a kind of rig calls."""
    return kind.hooks | _BODY if kind.of_capsule or kind.runs else kind.hooks


def signals_of(kind: str) -> frozenset[str]:
    """The signals that a kind of rig has; the others are 0 there."""
    signals = KINDS[kind].signals
    return _MOVING if signals is None else signals


_ONE_WAY: Final = ("t", "travelled", "dwell", "command")
_BACK: Final = {name: value if name in _ONE_WAY else -value for name, value in TRIED.items()}
_REST: Final = dict.fromkeys(TRIED, 0.0) | {"direction": 1.0}  # signals of a capsule at rest
_SHORT_S: Final = 1e-7  # step from which the rate of a hidden state is taken
_BEHIND: Final = 2e-4  # share by which a hidden state is off what it follows
_FACTORS: Final = ("level", "stiffening", "gain", "reach")
_STATE: Final = 0.2  # value of every hidden state
_UNSEEN: Final = ("advance", "follow", "response")
"""Hooks whose values alone change no prediction."""


def first_failure(effect: type[Effect], known: Collection[str]) -> str | None:
    """The first rule that `effect` breaks, in a sentence; None where it breaks none. `known` are the ids in use."""
    for check in CHECKS.values():
        try:
            with np.errstate(all="ignore"):
                failure = next(check(effect, known), None)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - a user's hook raises whatever it likes
            frames = [f for f in extract_tb(error.__traceback__) if f.filename == getsourcefile(effect)]
            where = f"{frames[-1].name}, line {frames[-1].lineno}" if frames else f"'{check.__doc__}'"
            names = [p.name for p in effect.parameters()]
            hint = f"; {nearest(str(error.args[0]), [*names, *effect.states])}" if isinstance(error, KeyError) else ""
            failure = f" must run; got {type(error).__name__} in {where}: {_words(error)}{hint}"
        if failure is not None:
            return f"{effect.__name__}{failure}"
    return None


def values_of(effect: type[Effect]) -> dict[str, float]:
    """The parameters at their defaults, the amplitude at its probe."""
    return {p.name: p.value for p in effect.parameters()} | {effect.amplitude().name: effect.probe}


def answers(effect: type[Effect], p: Mapping[str, Any], z: Mapping[str, Any], s: Mapping[str, Any]) -> dict[str, Any]:
    """The value of every hook that `effect` defines at parameters `p`, states `z` and signals `s`."""
    return dict(answered(effect, p, z, s, USUAL))


def _words(error: BaseException) -> str:
    return " ".join(str(error).split())[:160]


def _points(effect: type[Effect]) -> Iterator[tuple[str, dict[str, float]]]:
    """Signals to try the hooks at, as each of the effect's kinds of rig has them."""
    for kind, point in product(sorted(effect.kinds), (TRIED, _BACK, _REST)):
        yield kind, {name: value if name in signals_of(kind) else 0.0 for name, value in point.items()}


def _nothing(hook: str, s: Mapping[str, float], given: Mapping[str, float] = USUAL) -> float:
    """The value of `hook` without an effect."""
    unchanged = {
        "command": s["command"],
        "measured": given["y"],
        "direction": s["direction"],
        "recovery": given["speed"],
    }
    unchanged |= dict.fromkeys(SIDES, given["factors"])
    return unchanged.get(hook, 1.0 if hook in _FACTORS else 0.0)


def _of_kinds(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """kinds of rig"""
    known_kinds = (*KINDS, DRIVEN_AXIS.id)
    strange = sorted(str(kind) for kind in effect.kinds if kind not in known_kinds)
    if not effect.kinds or strange:
        yield f".kinds must be among {', '.join(known_kinds)}; got {repr(strange[0]) if strange else 'none'}"
    own = [hook for hook in HOOKS if effect.answers(hook)]
    if not own:
        yield f" must define a hook; got none; hooks are {', '.join(HOOKS)}"
    for kind in sorted(effect.kinds):
        for unread in (hook for hook in own if hook not in hooks_of(KINDS[kind])):
            asked = ", ".join(hook for hook in HOOKS if hook in hooks_of(KINDS[kind]))
            yield f".kinds must be rigs that call its hooks; got {kind!r}, which calls {asked}, never {unread}"


def _numbers(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """numbers"""
    p, z = values_of(effect), dict.fromkeys(effect.states, _STATE)
    for hook in ("advance", "follow"):
        call: Any = getattr(effect(), hook)
        got = call(Signals(**TRIED), p, z, *((1e-3,) if hook == "advance" else (0.03, 1e-3)))
        if not isinstance(got, Mapping) or not set(got) <= set(effect.states):
            yield f".{hook} must return a dict of the states {effect.states}; got {got!r}"
    sides = len(effect().shared(p, (1.0, 1.0, 1.0)))
    if sides != 3:
        yield f".shared must return three factors; got {sides}"
    for state in sorted(set(effect.states) - {hook.partition(".")[2] for hook in answers(effect, p, z, TRIED)}):
        yield f".states must each be given by advance or follow; got {state!r}, which is not"
    rng = np.random.default_rng(3)
    drawn = [{q.name: float(rng.uniform(q.lower, q.upper)) for q in effect.parameters()} for _ in range(3)]
    for values, (kind, s) in product((p, *drawn), _points(effect)):
        for hook, value in answers(effect, values, z, s).items():
            if np.shape(value) != () or np.asarray(value).dtype.kind not in "biuf":
                yield f".{hook} must return one number; got {type(value).__name__} {value}"
            if not np.isfinite(value):
                where = ", ".join(f"{key} = {number:.3g}" for key, number in {**values, **s}.items() if number)
                yield f".{hook} must be finite; got {value} on {kind} at {where}"


def _symbols(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """arrays and CasADi symbols"""
    p, z = values_of(effect), dict.fromkeys(effect.states, _STATE)
    plain = answers(effect, p, z, TRIED)
    symbols = [{name: ca.SX.sym(name) for name in table} for table in (p, z, TRIED)]
    try:
        symbolic = {hook: ca.SX(value) for hook, value in answers(effect, *symbols).items()}
        arrays = answers(effect, p, z, {k: np.full(3, v) for k, v in TRIED.items()})
    except Exception as error:  # noqa: BLE001 - whatever a branch on a symbol raises
        yield f" must trace to CasADi symbols (np.where, np.tanh, ... instead of if, math); got: {_words(error)}"
    evaluate = ca.Function("f", [s for table in symbols for s in table.values()], list(symbolic.values()))
    got = evaluate.call([value for table in (p, z, TRIED) for value in table.values()])
    for hook, value in zip(symbolic, got, strict=True):
        if value.shape != (1, 1) or not np.isclose(float(value), float(plain[hook]), rtol=1e-10, atol=1e-15):
            yield f".{hook} must give the same for symbols as for numbers; got {value} and {float(plain[hook]):g}"
        same = np.shape(arrays[hook]) in ((), (3,)) and np.allclose(arrays[hook], plain[hook], rtol=1e-10, atol=1e-15)
        if not same:
            yield f".{hook} must give the same for arrays as for numbers; got {arrays[hook]} and {plain[hook]:g}"
    said = ca.vertcat(*symbolic.values())
    for key in (key for key, symbol in symbols[0].items() if not ca.depends_on(said, symbol)):
        yield f" must use each parameter; got {key!r}, which changes no hook"


def _silent(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """amplitude zero"""
    p = values_of(effect) | {effect.amplitude().name: 0.0}
    for kind, signals in _points(effect):
        z: dict[str, Any] = dict.fromkeys(effect.states, _STATE)
        e, s = effect(), Signals(**signals)
        z = z | e.advance(s, p, z, 1e-3) | e.follow(s, p, z, 0.03, 1e-3)
        for hook, value in answers(effect, p, z, signals).items():
            nothing = _nothing(hook, signals)
            free = hook == "link" or hook.startswith(("advance.", "follow."))
            if not free and not np.isclose(float(value), nothing, rtol=1e-6, atol=1e-11):
                at = f"where {effect.amplitude().name} is 0; got {float(value):g} on {kind}"
                yield f".{hook} must be {nothing:g} (no effect) {at}"


def _shown(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """what shows"""
    rng, p = np.random.default_rng(5), values_of(effect)
    hidden = set(effect.kinds)
    for kind, k in product(sorted(effect.kinds), range(12)):
        s = {n: v * rng.uniform(-3, 3) if n in signals_of(kind) else 0.0 for n, v in TRIED.items()}
        s |= {name: abs(s[name]) for name in _ONE_WAY} | {"direction": float(k % 2 * 2 - 1)}
        z = {state: float(rng.uniform(0.05, 0.9)) for state in effect.states}
        given = {name: value * rng.uniform(0.1, 3) for name, value in USUAL.items()}
        said = dict(answered(effect, p, z, s, given))
        if any(v != _nothing(hook, s, given) for hook, v in said.items() if hook.partition(".")[0] not in _UNSEEN):
            hidden.discard(kind)
    for kind in sorted(hidden):
        lacking = ", ".join(name for name in TRIED if name not in signals_of(kind))
        got = f"nothing at its probe on {kind!r}" + f", which has no {lacking}" * bool(lacking)
        yield f" must show on each of its kinds of rig; got {got}"


def _finite(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
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
        for name, value in ((name, float(value)) for name, value in z.items() if not abs(float(value)) < 10.0):
            yield f"'s state {name!r} must stay bounded with steps of 1 s; got {value:g}"


def _printed(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """printed equations"""
    known_letters = effect.letters()
    letters = [known_letters.get(name, name) for name in (*values_of(effect), *effect.states)]
    taken = [*letters, *(symbol for symbol, *_ in SIGNALS.values())]
    for letter in sorted({letter for letter in letters if taken.count(letter) > 1}):
        yield f".symbols must differ from each other and from those of signals; got {letter!r} twice"
    p = Symbols(effect, {})
    trees = dict(traced(effect, p))
    for seed in range(8):
        drawn = _drawn(effect, p, np.random.default_rng(seed), usual=seed >= 4)
        names = names_in(effect, *drawn)
        for hook, right in answered(effect, *drawn):
            for as_written in (False, seed >= 4):
                value = value_of(trees[hook], names, as_written=as_written)
                if not np.isclose(float(value), float(right), rtol=1e-9, atol=1e-12):
                    got = f"{hook}: the printed equation gives {float(value):.6g}, the hook {float(right):.6g}"
                    yield f" must compute what its equations say; got {got}"
        if seed >= 4:
            yield from _stated(effect, *drawn)


Drawn = tuple[dict[str, float], dict[str, float], dict[str, float], dict[str, float]]


def _drawn(effect: type[Effect], asked: Collection[str], rng: np.random.Generator, *, usual: bool) -> Drawn:
    """Parameters, states, signals and arguments: anywhere within their bounds, or of `usual` size, where none acts."""
    own = values_of(effect)
    given = {name: value * rng.uniform(0.5, 2) for name, value in USUAL.items()}
    s = {name: value * rng.uniform(0.5, 1.5) for name, value in TRIED.items()}
    z = {state: float(rng.uniform(0.05, 0.9)) for state in effect.states}
    p = {q.name: min(max(own[q.name] * rng.uniform(0.9, 1.1), q.lower), q.upper) for q in effect.parameters()}
    if usual:
        followed = {"command": s["command"], "position": given["y"]}
        z |= {state: followed[effect.follows[state]] * (1 + _BEHIND) for state in effect.follows}
    else:
        p = {q.name: float(rng.uniform(q.lower, q.upper)) for q in effect.parameters()}
        s = {name: float(rng.normal(0, 0.3)) for name in TRIED}
        s |= {name: abs(s[name]) for name in ("t", "travelled", "dwell")} | {"v": 0.05 * s["v"]}
    p |= {name: float(rng.uniform(0.1, 1.0)) for name in sorted(asked) if name not in p}  # of the effect it refines
    return p, z, s | {"direction": float(np.sign(s["v"]))}, given


def _stated(
    effect: type[Effect], p: dict[str, float], z: dict[str, float], s: dict[str, float], given: dict[str, float]
) -> Iterator[str]:
    """The stated equations that are not those of the hooks; of a hidden state by its rate over a short step."""
    letters = effect.letters()
    said, names = dict(answered(effect, p, z, s, given | {"h": _SHORT_S})), names_in(effect, p, z, s, given)
    for state in effect.states:
        end = said.get(f"advance.{state}", said.get(f"follow.{state}", z[state]))
        names[f"{letters.get(state, state)}'"] = (end - z[state]) / _SHORT_S
    for key, formulas in own_forms(effect).items():
        if key in effect.states:
            values = {}
        elif key == "modulus":
            values = {LEFT[key][0]: said["modulus.storage"] + 1j * said["modulus.loss"], "i": 1j}
        else:
            values = {LEFT[key][0]: said[key]}
        known = names | values
        if formulas and all(value_of(condition, known) for condition in formulas[1:]):
            left, right = (value_of(side, known, as_written=True) for side in formulas[0].inputs)
            if not abs(left - right) <= 0.01 * abs(right) + 1e-9:
                yield f".forms must be what its hooks compute; got {left:.6g} = {right:.6g} for {key}"


CHECKS: Final[Mapping[str, Callable[[type[Effect], Collection[str]], Iterator[str]]]] = {
    "declared": declared,
    "parameters": of_parameters,
    "signatures": hooked,
    "kinds": _of_kinds,
    "finite": _numbers,
    "symbols": _symbols,
    "silent_at_zero": _silent,
    "shown": _shown,
    "bounded_states": _finite,
    "equations": _printed,
}
