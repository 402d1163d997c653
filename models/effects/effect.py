"""What an effect is: parameters, hidden states, and what it adds to the base model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import isfunction
from types import MappingProxyType
from typing import Any, ClassVar, Final

from models.files.toml import beside
from models.formula import Formula
from models.laws.five_elements import DynamicModulus
from models.parameter import Parameter, Role

Value = Any
"""A number, an array or a CasADi symbol: a hook serves all of them."""
Values = Mapping[str, Value]
Shares = tuple[Value, Value, Value]
Forms = Mapping[str, Sequence[Formula]]
NEEDS: Final = (
    *("both_ways", "reversals", "speeds", "places", "rests", "time"),
    *("load", "logged", "samples", "wall", "turning"),
)
"""What a motion may offer for an effect to show."""
_WORDS: Final = beside(__file__, "effects.toml")


@dataclass(frozen=True)
class Signals:
    """Inputs of an effect within one step, SI units: numbers, arrays or CasADi symbols. `t` time, `x` position along
    the lumen, `v` speed, `direction` smooth sign of the motion (the last one while at rest), `command` the drive's
    command (carriage position, coil current, drive on), `rate` its rate of change, `travelled` path length so far,
    `tension` the wall's quasi-static tension, `drag` the wall's displacement, `drag_rate` its rate, `dwell` time at
    rest, `load` the logged load, `loads` several by name. A kind of rig without such a signal leaves it at 0.
    """

    t: Value = 0.0
    x: Value = 0.0
    v: Value = 0.0
    direction: Value = 0.0
    command: Value = 0.0
    rate: Value = 0.0
    travelled: Value = 0.0
    tension: Value = 0.0
    drag: Value = 0.0
    drag_rate: Value = 0.0
    dwell: Value = 0.0
    load: Value = 0.0
    loads: Value = field(default_factory=dict)

    def logged(self, name: str) -> Value:
        """The logged input `name`; the load where none is told apart."""
        return self.loads.get(name, self.load)


def number(
    value: float,
    unit: str = "1",
    lower: float = -math.inf,
    upper: float = math.inf,
    source: str = "",
    *,
    fit: bool = True,
    spread: float = math.inf,
    role: Role = "",
    least: float = 0.0,
    symbol: str = "",
) -> Parameter:
    """A parameter of an effect, named after its attribute; the effect's source where it has none of its own."""
    return Parameter("", value, unit, lower, upper, source, fit, spread, role, least, symbol=symbol)


def by_name(**entries: Any) -> Mapping[str, Any]:
    """A table of an effect, by the names of its parameters or states."""
    return MappingProxyType(entries)


@dataclass(frozen=True)
class Effect:
    """An effect beyond the base model. Every hook's default is "no effect".

    `words` is its name with an article ("a lagging drive"), `summary` says what it does, `separated_by` what separates
    it from its confounders: those of ours stand in `effects.toml`.
    `symbols` are letters of states in equations, beside those of the parameters.
    Subclasses declare their parameters as attributes, each a `number(...)`; the first one is the amplitude, and at its
    value 0 the effect is absent. Hooks get the signals `s`, the parameters' values `p` by field name and the hidden
    states `z` by name. `by_speed` says that the level changes with the speed and not only with its direction, `exact`
    that its law has no shape to be missed. `follows` names the states that are at the "command" or the "position" after
    a long rest; the others are at 0. A refinement `of` one effect gets that effect's values too. `needs` names what the
    motion must offer for the effect to show: "both_ways", "reversals", "speeds", "places", "rests", "time", "load" (a
    logged one of different sizes), "logged" (an input that changes), "samples" (more than two a mains period), "wall"
    (of living tissue, none on a plate), "turning" (an axis that turns; only its search tries such an effect).
    `behind` is the state by which the load's place is behind that of its drive. `proposed_on` names the records whose
    residual proposed it.
    """

    id: ClassVar[str] = ""
    words: ClassVar[str] = ""
    summary: ClassVar[str] = ""
    source: ClassVar[str] = ""
    kinds: ClassVar[frozenset[str]] = frozenset()
    states: ClassVar[tuple[str, ...]] = ()
    symbols: ClassVar[Mapping[str, str]] = MappingProxyType({})
    follows: ClassVar[Mapping[str, str]] = MappingProxyType({})
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType({})
    probe: ClassVar[float] = 0.1
    confounders: ClassVar[tuple[str, ...]] = ()
    separated_by: ClassVar[str] = ""
    refined_by: ClassVar[tuple[str, ...]] = ()
    of: ClassVar[str] = ""
    by_speed: ClassVar[bool] = False
    exact: ClassVar[bool] = False
    behind: ClassVar[str] = ""
    needs: ClassVar[tuple[str, ...]] = ()
    proposed_on: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        for name, text in _WORDS.get(str(vars(cls).get("id")), {}).items():
            setattr(cls, name, text)

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """The effect's parameters in the order of their declaration, the amplitude first."""
        declared = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
        return tuple(value for value in declared.values() if isinstance(value, Parameter))

    @classmethod
    def amplitude(cls) -> Parameter:
        """The parameter whose value 0 switches the effect off."""
        return cls.parameters()[0]

    @classmethod
    def of_role(cls, role: str) -> str | None:
        """The name of the first parameter with this `role`; None where there is none."""
        return next((p.name for p in cls.parameters() if p.role == role), None)

    @classmethod
    def letters(cls) -> dict[str, str]:
        """The symbols of parameters and states in equations, by their names."""
        return {p.name: p.symbol or p.name for p in cls.parameters()} | dict(cls.symbols)

    @classmethod
    def looks_like(cls, other: type[Effect]) -> bool:
        """Whether this effect or the `other` declares to be confounded with it."""
        return cls.id in other.confounders or other.id in cls.confounders

    @classmethod
    def loaded(cls) -> bool:
        """Whether it takes a logged load, pressure or temperature."""
        return not {"load", "logged"}.isdisjoint(cls.needs)

    @classmethod
    def start(cls) -> dict[str, float]:
        """The declared values, at which a search without prior knowledge begins."""
        return {p.name: p.value for p in cls.parameters()}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        """Textbook equations and conditions on them, by the name of the hook or the hidden state whose traced equation
        they replace. The symbol of a state's rate is the state's with a prime.
        """
        return {}

    @classmethod
    def answers(cls, hook: str) -> bool:
        """Whether the effect defines `hook`."""
        return getattr(cls, hook, HOOKS[hook]) is not HOOKS[hook]

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        """Factor on the wall's grip, that is on F_e and f_c (on the Coulomb friction of a plate or an axis)."""
        return 1.0

    def direction(self, s: Signals, p: Values, z: Values) -> Value:
        """What the friction of an axis follows in place of the sign of the motion, from -1 to 1."""
        return s.direction

    def shared(self, p: Values, factors: Shares) -> Shares:
        """Factors on F_e, `mu m g` and `mu N_p` (the slip limit's parts), given the product of all `level`s."""
        return factors

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        """Extra force on the capsule along +x in N; a resistance has the sign of -v."""
        return 0.0

    def normal_load(self, s: Signals, p: Values, z: Values) -> Value:
        """Extra force in N that presses the capsule on its surface, in addition to the weights."""
        return 0.0

    def stiffening(self, s: Signals, p: Values, z: Values) -> Value:
        """Factor on the wall's tension T(u)."""
        return 1.0

    def wall_force(self, s: Signals, p: Values, z: Values) -> Value:
        """Extra force in N of the wall against being dragged; it does not count in the slip condition."""
        return 0.0

    def recovery(self, s: Signals, p: Values, z: Values, speed: Value, onset: Value) -> Value:
        """Speed in m/s at which a slipping wall draws back, given the base's and the drag `onset` u_c at slip."""
        return speed

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        """The command that arrives at the capsule."""
        return s.command

    def response(self, p: Values) -> Value:
        """Time constant in s with which the command arrives."""
        return 0.0

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        """Factor on the drive's force."""
        return 1.0

    def link(self, p: Values) -> Any:
        """The elastic link (`models.drives.elastic_link.Link`) through which a rig pulls; None for a rigid one."""
        return None

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        """The reading of the true output `y`."""
        return y

    def delay(self, p: Values) -> Value:
        """Time in s by which the measurement is late."""
        return 0.0

    def modulus(self, frequency_Hz: Value, p: Values) -> DynamicModulus:
        """Storage and loss modulus in Pa that it adds to the wall's at `frequency_Hz`, any shape."""
        return DynamicModulus(0.0, 0.0)

    def follow(self, s: Signals, p: Values, z: Values, y: Value, h: Value) -> dict[str, Value]:
        """The sensor's own hidden states after a step `h` in s during which the true output was `y`."""
        return {}

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        """The hidden states after a step `h` in s, unconditionally stable."""
        return {}


@dataclass(frozen=True)
class InnerMassEffect(Effect):
    """An effect of a vibro drive's suspension or coil; hooks get the inner mass's displacement in m, speed in m/s."""

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        """Extra force in N that pulls the inner mass back to the body (and the body after it)."""
        return 0.0

    def reach(self, stretch: Value, p: Values) -> Value:
        """Factor on the coil's force."""
        return 1.0


HOOKS: Final[Mapping[str, Callable[..., Any]]] = {
    name: hook
    for base in (Effect, InnerMassEffect)
    for name, hook in vars(base).items()
    if isfunction(hook) and not name.startswith("_")
}
"""Every hook with its default; the last two are `InnerMassEffect`'s alone."""
