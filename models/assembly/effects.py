"""The chosen effects of an assembled model together, each with its own parameters and states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import mul
from typing import Any

from models.drives.elastic_link import Link
from models.effects.effect import Effect, InnerMassEffect, Shares, Signals
from models.parameter import Name
from models.theta import Theta


@dataclass(frozen=True)
class Active:
    """The chosen effects with the model's parameters `p` and their hidden states `z`."""

    effects: tuple[type[Effect], ...]
    p: Theta
    z: Theta = field(default_factory=Theta)

    @classmethod
    def of(cls, effects: Iterable[type[Effect]], p: Mapping[Name, Any], states: Mapping[Name, Any]) -> Active:
        """The `effects` with their own of the `states` of a model."""
        chosen = tuple(effects)
        return cls(chosen, Theta.of(p), Theta(effects=Theta.of(states).only([e.id for e in chosen]).effects))

    def _each(self) -> Iterator[tuple[Effect, dict[str, Any], dict[str, Any]]]:
        """Each effect with its parameters and states, and those of the effect that it refines."""
        for e in self.effects:
            yield e(), _own(e, self.p), _own(e, self.z)

    def product(self, hook: str, s: Signals) -> Any:
        return reduce(mul, (getattr(e, hook)(s, p, z) for e, p, z in self._each()), 1.0)

    def total(self, hook: str, s: Signals) -> Any:
        return sum((getattr(e, hook)(s, p, z) for e, p, z in self._each()), 0.0)

    def passed(self, signal: str, s: Signals) -> Any:
        """A `signal`, the command or the direction, through the hook of its name of all effects."""
        for e, p, z in self._each():
            s = replace(s, **{signal: getattr(e, signal)(s, p, z)})
        return getattr(s, signal)

    def through(self, hook: str, s: Signals, value: Any, *more: Any) -> Any:
        """`value` through the `hook` of all effects, one after the other: a reading, or a speed of the wall."""
        for e, p, z in self._each():
            value = getattr(e, hook)(s, p, z, value, *more)
        return value

    def levels(self, s: Signals) -> Shares:
        """Factors on F_e and on the two parts of the slip limit, by the weight and by the wall's pressure."""
        level = self.product("level", s)
        factors = (level, level, level)
        for e, p, _ in self._each():
            factors = e.shared(p, factors)
        return factors

    def link(self) -> Link | None:
        """The elastic link through which the rig pulls; None for a rigid one."""
        return next((link for e, p, _ in self._each() if (link := e.link(p)) is not None), None)

    def advance(self, s: Signals, h: Any) -> Active:
        """The effects with hidden states a step `h` later, each under the command that the one before passes on."""
        after = self.z
        for e, p, _ in self._each():
            z = _own(type(e), after)
            after = after.with_(e.id, e.advance(s, p, z, h))
            if e.answers("command"):
                start = e.command(replace(s, command=s.command - s.rate * h), p, z)
                end = e.command(s, p, _own(type(e), after))
                s = replace(s, command=end, rate=(end - start) / h)
        return replace(self, z=after)

    def suspension(self, stretch: Any, rate: Any) -> Any:
        """Force in N beside the inner mass's spring."""
        return sum((e.suspension(stretch, rate, p) for e, p, _ in self._each() if isinstance(e, InnerMassEffect)), 0.0)

    def reach(self, stretch: Any) -> Any:
        """Factor on the force of the inner mass's coil."""
        return reduce(mul, (e.reach(stretch, p) for e, p, _ in self._each() if isinstance(e, InnerMassEffect)), 1.0)

    def follow(self, s: Signals, y: Any, h: Any) -> Theta:
        """The hidden states after the sensor measured `y` for a step `h`, through one effect after the other."""
        after = self.z
        for e, p, _ in self._each():
            after = after.with_(e.id, e.follow(s, p, _own(type(e), after), y, h))
            y = e.measured(s, p, _own(type(e), after), y)
        return after


def _own(effect: type[Effect], table: Theta) -> dict[str, Any]:
    return {**table.effects.get(effect.of, {}), **table.effects.get(effect.id, {})}
