"""What a rig may have beyond the base model: the effects that the files of `GROUPS` declare.

Each class there with an `id` is an effect. Those in `refinements.py` give the shape of an effect that is already named
more freedom; all others are candidates of the search.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Final

from models.effects import drive, force, friction, inner_mass, refinements, sensor, wall
from models.effects.effect import Effect
from models.effects.own import Origin, own_effects
from models.rigs.kinds import KINDS
from models.rigs.rig import Rig

GROUPS: Final = (friction, force, wall, drive, sensor, inner_mass)


def _declared(*modules: ModuleType) -> tuple[type[Effect], ...]:
    found = [
        value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Effect) and value.__module__ == module.__name__ and value.id
    ]
    return tuple(sorted(found, key=lambda effect: effect.id))


EFFECTS: Final = _declared(*GROUPS)
REFINEMENTS: Final = _declared(refinements)
"""Free curves and further orders that refine the shape of a named effect; never candidates."""


@dataclass(frozen=True)
class Catalogue(Mapping[str, type[Effect]]):
    """Every effect that may take part, by id: ours, its `own` from outside; `variants` replace them on one rig."""

    own: tuple[Origin, ...] = ()
    variants: tuple[type[Effect], ...] = ()

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Catalogue:
        """With the effects of Python files and installed packages. Raises ValueError where one cannot be used."""
        return cls(own_effects(paths, CATALOGUE))

    @classmethod
    def of(cls, rig: Rig) -> Catalogue:
        """With the effects from outside that a rig may have."""
        return cls(rig.own_effects)

    def given_to(self, rig: Rig) -> Rig:
        """`rig`, which may have the effects from outside of this catalogue."""
        return replace(rig, own_effects=self.own)

    @cached_property
    def _by_id(self) -> dict[str, type[Effect]]:
        own = (origin.effect for origin in self.own)
        return {effect.id: effect for effect in (*EFFECTS, *REFINEMENTS, *own, *self.variants)}

    def __getitem__(self, name: str) -> type[Effect]:
        return self._by_id[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_id)

    def __len__(self) -> int:
        return len(self._by_id)

    @property
    def candidates(self) -> tuple[type[Effect], ...]:
        """Those that a search can find."""
        return (*EFFECTS, *(origin.effect for origin in self.own))

    def acting_on(self, kind: str, variants: Sequence[type[Effect]] = ()) -> tuple[type[Effect], ...]:
        """The candidates that can act on a rig of `kind`; `variants` with its own bounds or units replace them."""
        more = KINDS[kind].effects
        declared = {effect.id: effect for effect in self.candidates if kind in effect.kinds or effect.id in more}
        return tuple((declared | {variant.id: variant for variant in variants}).values())


CATALOGUE: Final = Catalogue()
"""The project's effects alone."""


def effect_words(name: str, catalogue: Mapping[str, type[Effect]] = CATALOGUE) -> str:
    """The name of an effect in words with an article; the id with blanks where the effect declares none."""
    declared = catalogue.get(name)
    return (declared.words if declared else "") or name.replace("_", " ")
