"""An effect's equations as text, written down from its hooks: what is printed is what is computed."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from inspect import signature
from typing import Any, Final

import numpy as np

from models.effects.effect import HOOKS, Effect, Signals
from models.effects.formula import Formula, called, value_of, written
from models.parameter import Name
from models.theta import Theta, bare

LEFT: Final[Mapping[str, str]] = {
    "level": "friction scale",
    "nose": "factor on F_e",
    "weight": "factor on mu m g",
    "pressed": "factor on mu N_p",
    "force": "added force in N",
    "normal_load": "added normal load in N",
    "stiffening": "factor on T(u)",
    "wall_force": "added wall force in N",
    "recovery": "v_i",
    "command": "command that arrives",
    "response": "time constant of the command in s",
    "gain": "factor on the drive's force",
    "measured": "reading",
    "delay": "delay of the reading in s",
    "suspension": "added force of the spring in N",
    "reach": "factor on the coil's force",
    "link": "force in N of the link at the stretch e",
    "modulus.storage": "added storage modulus in Pa",
    "modulus.loss": "added loss modulus in Pa",
}
"""What each hook gives, by the hook's name; states are called by their own."""
SIDES: Final = ("nose", "weight", "pressed")
_SYMBOLS: Final = {
    "y": "y", "h": "h", "speed": "v_i", "onset": "u_c", "stretch": "xi", "rate": "xi_rate", "frequency_Hz": "f",
}  # fmt: skip
ARGUMENTS: Final = (*_SYMBOLS.values(), *SIDES, "e", "e_rate")
"""Names in formulas beside signals, parameters and states: the true output, a step in s, the base model's speed of
drawing back and the drag at which it slips, the inner mass's displacement and speed, a frequency in Hz, factors as
`level` has them, a link's stretch and its rate.
"""


@dataclass(frozen=True)
class Equation:
    """`left = right` of one `hook` (of a state, by its name, for `advance` and `follow`); written with so many
    `digits`.
    """

    hook: str
    left: str
    right: Formula
    digits: int | None = None

    def __str__(self) -> str:
        return f"{self.left} = {written(self.right, self.digits)}"


def equations_of(
    effect: type[Effect], values: Mapping[str, float] | None = None, digits: int | None = None
) -> list[Equation]:
    """The equations of every hook that `effect` answers, in the names of the signals, states and parameters; with
    `values` their numbers, with so many `digits`, stand in place of the parameters, and what they make 0 drops out.
    """
    p = _Symbols(values or {})
    own = [Equation(hook, left, Formula.of(right), digits) for hook, left, right in effect.further(p)]
    found = [
        Equation(hook, _left(effect, hook), Formula.of(right), digits)
        for hook, right in _traced(effect, p)
        if all(hook.partition(".")[0] != equation.hook for equation in own)
    ]
    return [*found, *own]


def text_of(effect: type[Effect], values: Mapping[str, float] | None = None) -> str:
    """The equations in one line; numbers with four digits."""
    return "; ".join(str(equation) for equation in equations_of(effect, values, 4))


def about_axis(line: str) -> str:
    """An equation's line as it reads for an axis that turns, where a force is a torque."""
    return line.replace(LEFT["force"], "added torque in N m")


def lines_of(effects: Iterable[type[Effect]], theta: Theta) -> list[str]:
    """A line with the equations of each effect that has an entry in `theta`, with all its numbers: those given and the
    defaults of the others.
    """
    lines = []
    for effect in effects:
        given = theta.effects.get(effect.id)
        if given:
            values = {**theta.effects.get(effect.of, {}), **effect.start(), **given}
            lines.append(f"{effect.id}: {text_of(effect, values)}")
    return lines


def symbols_of(theta: Theta, fitted: Iterable[Name]) -> Theta:
    """`theta` with the symbols of those that were `fitted` in place of their numbers: what writes a model's equations
    with its numbers writes them with these too.
    """
    symbols: dict[Name, Any] = {name: _symbol(name) for name in fitted if name in theta}
    return theta | symbols


def _symbol(name: Name) -> Formula:
    own = bare(name)
    return called("log10", Formula(own.removeprefix("log10_"))) if own.startswith("log10_") else Formula(own)


def answered(
    effect: type[Effect], p: Mapping[str, Any], z: Mapping[str, Any], s: Mapping[str, Any], given: Mapping[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Every hook that `effect` answers with what it says at parameters `p`, states `z`, signals `s` and the arguments
    `given` by the names of `ARGUMENTS`; a state's as `advance.NAME` or `follow.NAME`, a modulus's as `modulus.storage`
    and `modulus.loss`.
    """
    e, factors = effect(), tuple(given[side] for side in SIDES)
    known = {"s": Signals(**s), "p": p, "z": z, "factors": factors} | {a: given[b] for a, b in _SYMBOLS.items()}
    for hook, base in HOOKS.items():
        if effect.answers(hook):
            said = getattr(e, hook)(*(known[name] for name in list(signature(base).parameters)[1:]))
            if hook == "shared":
                yield from zip(SIDES, said, strict=True)
            elif hook == "link":
                yield hook, said.force(given["e"]) + said.damping * given["e_rate"]
            elif hook == "modulus":
                yield from ((f"modulus.{name}", getattr(said, name)) for name in ("storage", "loss"))
            elif hook in ("advance", "follow"):
                yield from ((f"{hook}.{name}", value) for name, value in said.items())
            else:
                yield hook, said


def disagreement(effect: type[Effect], rng: np.random.Generator) -> str | None:
    """Where the printed equations of `effect` give another value than its hooks do at random numbers; None where they
    agree.
    """
    p = {q.name: float(rng.uniform(q.lower, q.upper)) for q in effect.parameters()}
    asked = _Symbols()  # a refinement asks for the numbers of its effect too
    trees = {hook: Formula.of(right) for hook, right in _traced(effect, asked)}
    p |= {name: float(rng.uniform(0.1, 1.0)) for name in asked if name not in p}
    s = {f.name: float(rng.normal(0, 0.3)) for f in fields(Signals)}
    s |= {"t": abs(s["t"]), "travelled": abs(s["travelled"]), "dwell": abs(s["dwell"]), "v": 0.05 * s["v"]}
    z = {state: float(rng.uniform(0.05, 0.9)) for state in effect.states}
    given = {name: float(rng.uniform(0.01, 0.5)) for name in ARGUMENTS}
    states = {symbol.name: z[state] for state, symbol in _states(effect).items()}
    for hook, right in answered(effect, p, z, s, given):
        value = value_of(trees[hook], {**s, **given, **p, **states})
        if not np.isclose(float(value), float(right), rtol=1e-9, atol=1e-12):
            return f"{hook}: the printed equation gives {float(value):.6g}, the hook {float(right):.6g}"
    return None


def _states(effect: type[Effect]) -> dict[str, Formula]:
    """A symbol for each hidden state, apart from a signal of the same name."""
    signals = {f.name for f in fields(Signals)}
    return {state: Formula(f"{state}_state" if state in signals else state) for state in effect.states}


def _left(effect: type[Effect], hook: str) -> str:
    if hook not in LEFT:
        state = hook.partition(".")[2]
        return f"{_states(effect)[state].name} after a step of h"
    return LEFT[hook]


class _Symbols(dict[str, Any]):
    """Parameters as formulas, or as their numbers where these are given; it remembers which were asked for."""

    def __missing__(self, name: str) -> Any:
        self[name] = Formula(name)
        return self[name]


def _traced(effect: type[Effect], p: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """What every hook that `effect` answers says of symbols."""
    names = {f.name: Formula(f.name) for f in fields(Signals)}
    return answered(effect, p, _states(effect), names, {name: Formula(name) for name in ARGUMENTS})
