"""An effect's equations, traced from its hooks: what is written is what is computed."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from inspect import signature
from typing import Any, Final

from models.effects.effect import HOOKS, Effect, Signals
from models.files.toml import beside
from models.formula import Formula, Line, called, equal, written
from models.parameter import Name
from models.theta import Theta, bare

_TABLES: Final = beside(__file__, "equation.toml")
LEFT: Final[Mapping[str, Sequence[str]]] = _TABLES["left"]
"""The left side of the equation of each hook, and what it is."""
SIDES: Final = ("nose", "weight", "pressed")
SIGNALS: Final[Mapping[str, Sequence[Any]]] = _TABLES["signals"]
ARGUMENTS: Final[Mapping[str, Sequence[Any]]] = _TABLES["arguments"]
"""Inputs of hooks other than signals, parameters and states: the symbol, what it is, and a usual value."""
LETTERS: Final[Mapping[str, str]] = _TABLES["letters"]
"""Letters of the base models' parameters in equations."""
TRIED, USUAL = ({name: value for name, (*_, value) in table.items()} for table in (SIGNALS, ARGUMENTS))
"""The usual values of signals and of arguments."""
TORQUE: Final = "T_extra"
"""What an added force is called about an axis."""
_UNWRITTEN: Final = ("response",)


def equations_of(
    effect: type[Effect], values: Mapping[str, float] | None = None, *, turns: bool = False
) -> list[Formula]:
    """The equations of every hook that `effect` defines, and conditions on them. Parameters with `values` are numbers,
    and terms that are 0 drop out. About an axis that `turns` a force is a torque.
    """
    p, z = Symbols(effect, values or {}), _states(effect)
    forms, found = effect.forms(_signals(), p, z), list[Formula]()
    for hook, right in traced(effect, p):
        kind, _, state = hook.partition(".")
        if kind in forms or state in forms or kind in _UNWRITTEN:
            continue
        if kind in ("advance", "follow"):
            left = called(z[state].name, Formula("t") + Formula("h"))
        else:
            left = Formula(TORQUE if turns and hook == "force" else LEFT.get(hook, LEFT.get(kind, ("", "")))[0])
        right = called("y_0", Formula("t") - right) if hook == "delay" else right
        if right.name != left.name:
            found.append(equal(left, right))
    return [*found, *(formula for formulas in forms.values() for formula in formulas)]


def text_of(effect: type[Effect], values: Mapping[str, float] | None = None) -> str:
    """The equations in one line; numbers with four digits."""
    return "; ".join(map(written, equations_of(effect, values)))


def lines_of(effects: Iterable[type[Effect]], theta: Theta, *, turns: bool = False) -> list[Line]:
    """A line with the equations of each effect that has an entry in `theta`, with all its numbers: those given and the
    defaults of the others. A value that is a formula leaves its parameter's symbol.
    """
    lines = list[Line]()
    for effect in effects:
        given = theta.effects.get(effect.id)
        if given:
            values = {**theta.effects.get(effect.of, {}), **effect.start(), **given}
            numbers = {name: value for name, value in values.items() if not isinstance(value, Formula)}
            parts: list[str | Formula] = [f"{effect.words or effect.id}: "]
            for formula in equations_of(effect, numbers, turns=turns):
                parts += [formula, "; "]
            lines.append(parts[:-1])
    return lines


def legend(lines: Iterable[Line]) -> dict[str, str]:
    """The meaning of the symbols in `lines` that are no parameters, in alphabetical order."""
    known = _TABLES["base"] | {entry[0]: entry[1] for table in (LEFT, SIGNALS, ARGUMENTS) for entry in table.values()}
    found = {name for line in lines for part in line if isinstance(part, Formula) for name in part.names()}
    return {name: known[name] for name in sorted(found & set(known), key=str.lower)}


def symbols_of(theta: Theta, fitted: Iterable[Name]) -> Theta:
    """`theta` with symbols in place of the `fitted` numbers, for a model's equations in symbols."""
    symbols: dict[Name, Any] = {name: _symbol(name) for name in fitted if name in theta}
    return theta | symbols


def _symbol(name: Name) -> Formula:
    own = bare(name)
    letter = Formula(LETTERS.get(own, own.removeprefix("log10_")))
    return called("log10", letter) if own.startswith("log10_") else letter


def answered(
    effect: type[Effect], p: Mapping[str, Any], z: Mapping[str, Any], s: Mapping[str, Any], given: Mapping[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Every hook that `effect` answers with what it says at parameters `p`, states `z`, signals `s` and the arguments
    `given` by the names of `ARGUMENTS`; a state's as `advance.NAME` or `follow.NAME`, a modulus's as `modulus.storage`
    and `modulus.loss`.
    """
    e = effect()
    known = {"s": Signals(**s), "p": p, "z": z, **given, "factors": (given["factors"],) * len(SIDES)}
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


def traced(effect: type[Effect], p: Mapping[str, Any]) -> Iterator[tuple[str, Formula]]:
    """The formula of every hook that `effect` defines."""
    given = {name: Formula(symbol) for name, (symbol, *_) in ARGUMENTS.items()}
    for hook, right in answered(effect, p, _states(effect), vars(_signals()), given):
        yield hook, Formula.of(right)


def names_in(
    effect: type[Effect], p: Mapping[str, Any], z: Mapping[str, Any], s: Mapping[str, Any], given: Mapping[str, Any]
) -> dict[str, Any]:
    """Values of parameters, states, signals and arguments by their symbols in the equations of `effect`."""
    letters = effect.letters()
    own = {letters.get(name, name): value for name, value in {**p, **z}.items()}
    seen = {symbol: s[name] for name, (symbol, *_) in SIGNALS.items()}
    return seen | {symbol: given[name] for name, (symbol, *_) in ARGUMENTS.items()} | own


def own_forms(effect: type[Effect]) -> Mapping[str, Any]:
    """The textbook's equations that `effect` states, by hook or state, in symbols."""
    return effect.forms(_signals(), Symbols(effect, {}), _states(effect))


def _signals() -> Signals:
    plain = {name: Formula(symbol) for name, (symbol, *_) in SIGNALS.items()}
    return Signals(**plain | {"direction": called("sgn", Formula("v"))})


def _states(effect: type[Effect]) -> dict[str, Formula]:
    letters = effect.letters()
    return {state: Formula(letters.get(state, state)) for state in effect.states}


class Symbols(dict[str, Any]):
    """Parameters of an effect as formulas, or as their numbers where these are given."""

    def __init__(self, effect: type[Effect], values: Mapping[str, Any]) -> None:
        super().__init__(values)
        self._letters = effect.letters()

    def __missing__(self, name: str) -> Any:
        self[name] = Formula(self._letters.get(name, name))
        return self[name]
