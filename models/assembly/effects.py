"""The chosen effects of an assembled model, asked together: each one's parameters and states under its own names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from models.drives.elastic_link import Link
from models.effects.effect import Effect, InnerMassEffect, Shares, Signals
from models.parameter import Name
from models.theta import Theta


@dataclass(frozen=True)
class Active:
    """The chosen effects with the model's parameters `p` and their hidden states `z`, asked together."""

    effects: tuple[type[Effect], ...]
    p: Theta
    z: Theta = field(default_factory=Theta)

    @classmethod
    def of(cls, effects: Iterable[type[Effect]], p: Mapping[Name, Any], states: Mapping[Name, Any]) -> Active:
        """The `effects` with theirs among the `states` of a model."""
        chosen = tuple(effects)
        return cls(chosen, Theta.of(p), Theta(effects=Theta.of(states).only([e.id for e in chosen]).effects))

    def _own(self, effect: type[Effect], table: Theta) -> dict[str, Any]:
        return {**table.effects.get(effect.of, {}), **table.effects.get(effect.id, {})}

    def product(self, hook: str, s: Signals) -> Any:
        """Product of the factors that the effects give under `hook`."""
        total: Any = 1.0
        for e in self.effects:
            total = total * getattr(e(), hook)(s, self._own(e, self.p), self._own(e, self.z))
        return total

    def total(self, hook: str, s: Signals) -> Any:
        """Sum of what the effects add under `hook`."""
        total: Any = 0.0
        for e in self.effects:
            total = total + getattr(e(), hook)(s, self._own(e, self.p), self._own(e, self.z))
        return total

    def command(self, s: Signals) -> Any:
        """The command after one effect after the other."""
        for e in self.effects:
            s = replace(s, command=e().command(s, self._own(e, self.p), self._own(e, self.z)))
        return s.command

    def measured(self, s: Signals, y: Any) -> Any:
        """What the sensor shows of `y`, one effect after the other."""
        for e in self.effects:
            y = e().measured(s, self._own(e, self.p), self._own(e, self.z), y)
        return y

    def recovery(self, s: Signals, speed: Any, onset: Any) -> Any:
        """The speed at which a slipping wall draws back."""
        for e in self.effects:
            speed = e().recovery(s, self._own(e, self.p), self._own(e, self.z), speed, onset)
        return speed

    def levels(self, s: Signals) -> Shares:
        """The factors on F_e and on the two parts of the slip limit, the weight's and what the wall presses."""
        level = self.product("level", s)
        factors = (level, level, level)
        for e in self.effects:
            factors = e().shared(self._own(e, self.p), factors)
        return factors

    def link(self) -> Link | None:
        """The elastic link through which the rig pulls; None for a rigid one."""
        links = (e().link(self._own(e, self.p)) for e in self.effects)
        return next((link for link in links if link is not None), None)

    def advance(self, s: Signals, h: Any) -> Active:
        """The effects, hidden states a step `h` later, each under the command that the one before lets through."""
        z = self.z
        for e in self.effects:
            p, before = self._own(e, self.p), self._own(e, z)
            z = z.with_(e.id, e().advance(s, p, before, h))
            if e.answers("command"):
                start = e().command(replace(s, command=s.command - s.rate * h), p, before)
                end = e().command(s, p, self._own(e, z))
                s = replace(s, command=end, rate=(end - start) / h)
        return replace(self, z=z)

    def suspension(self, stretch: Any, rate: Any) -> Any:
        """Force in N beside the inner mass's spring."""
        total: Any = 0.0
        for e in self.effects:
            if issubclass(e, InnerMassEffect):
                total = total + e().suspension(stretch, rate, self._own(e, self.p))
        return total

    def reach(self, stretch: Any) -> Any:
        """Factor on the force of the inner mass's coil."""
        product: Any = 1.0
        for e in self.effects:
            if issubclass(e, InnerMassEffect):
                product = product * e().reach(stretch, self._own(e, self.p))
        return product

    def follow(self, s: Signals, y: Any, h: Any) -> Theta:
        """The hidden states after the sensor saw `y` for a step `h`, each behind what the one before makes of it."""
        z = self.z
        for e in self.effects:
            p = self._own(e, self.p)
            z = z.with_(e.id, e().follow(s, p, self._own(e, z), y, h))
            y = e().measured(s, p, self._own(e, z), y)
        return z
