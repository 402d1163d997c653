"""The parameter vector as a value: the base's numbers by name, each effect's own apart from them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from models.parameter import Name, Parameter


def spelled(name: Name) -> str:
    """`name` as it is written in files and sentences: an effect's as `effect_id.name`."""
    return name if isinstance(name, str) else ".".join(name)


def bare(name: Name) -> str:
    """`name` without the id of its effect."""
    return name if isinstance(name, str) else name[1]


@dataclass(frozen=True, eq=False)
class Theta(Mapping[Name, float]):
    """Values of the `base` parameters by name, and of the `effects` by id and their own names: `theta["mass_kg"]`,
    `theta["fold_periodic", "wavelength_m"]`. An effect with no entry is absent.
    """

    base: Mapping[str, float] = field(default_factory=dict)
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @classmethod
    def of(cls, values: Mapping[Name, float] | Iterable[tuple[Name, float]]) -> Theta:
        """The vector with these values."""
        if isinstance(values, Theta):
            return values
        base: dict[str, float] = {}
        effects: dict[str, dict[str, float]] = {}
        for name, value in values.items() if isinstance(values, Mapping) else values:
            if isinstance(name, str):
                base[name] = value
            else:
                effects.setdefault(name[0], {})[name[1]] = value
        return cls(base, effects)

    @classmethod
    def read(cls, values: Mapping[str, float]) -> Theta:
        """The vector from the values of a file under their `spelled` names."""
        parts = ((text.partition("."), float(value)) for text, value in values.items())
        return cls.of(((effect, own) if dot else effect, value) for (effect, dot, own), value in parts)

    @classmethod
    def declared(cls, parameters: Iterable[Parameter]) -> Theta:
        """`parameters` at their declared values."""
        return cls.of((p.key, p.value) for p in parameters)

    def __getitem__(self, name: Name) -> float:
        return self.base[name] if isinstance(name, str) else self.effects[name[0]][name[1]]

    def __iter__(self) -> Iterator[Name]:
        yield from self.base
        yield from ((effect, name) for effect, own in self.effects.items() for name in own)

    def __len__(self) -> int:
        return len(self.base) + sum(map(len, self.effects.values()))

    def __or__(self, values: Mapping[Name, float]) -> Theta:
        """The same with other `values`, or further ones."""
        other = Theta.of(values)
        own = {effect: {**self.effects.get(effect, {}), **its} for effect, its in other.effects.items()}
        return Theta({**self.base, **other.base}, {**self.effects, **own})

    def spelled(self) -> dict[str, float]:
        """The values for a file, each under its `spelled` name."""
        return {spelled(name): value for name, value in self.items()}

    def with_(self, effect: str, values: Mapping[str, float]) -> Theta:
        """The same with these `values` of one effect."""
        return self | {(effect, name): value for name, value in values.items()}

    def without(self, *effects: str) -> Theta:
        """The same without the numbers of these effects."""
        return self.only([effect for effect in self.effects if effect not in effects])

    def only(self, effects: Collection[str]) -> Theta:
        """The base and the numbers of these effects."""
        return Theta(self.base, {effect: own for effect, own in self.effects.items() if effect in effects})
