"""What a rig may have beyond the base model: one file an effect, found in the folders below.

A class in `friction/`, `force/`, `wall/`, `drive/`, `sensor/` or `inner_mass/` is a candidate of the search; one in
`refinements/` gives the shape of an effect that is already named more freedom and is never a candidate by itself.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Final

from models.effects.effect import Effect
from models.effects.own import Origin, own_effects
from models.rigs.kinds import KINDS
from models.rigs.rig import Rig

_REFINEMENTS: Final = f"{__name__}.refinements."


def _declared() -> tuple[type[Effect], ...]:
    found = []
    for module in pkgutil.walk_packages(__path__, f"{__name__}."):
        classes = vars(import_module(module.name)).values()
        found += [
            c for c in classes if isinstance(c, type) and issubclass(c, Effect) and c.__module__ == module.name and c.id
        ]
    return tuple(sorted(found, key=lambda effect: effect.id))


_ALL: Final = _declared()
EFFECTS: tuple[type[Effect], ...] = tuple(e for e in _ALL if not e.__module__.startswith(_REFINEMENTS))
REFINEMENTS: tuple[type[Effect], ...] = tuple(e for e in _ALL if e.__module__.startswith(_REFINEMENTS))
"""Free curves and further orders that refine the shape of a named effect; never candidates."""


@dataclass(frozen=True)
class Catalogue(Mapping[str, type[Effect]]):
    """Every effect that may take part, by its id: the project's, and its `own` from outside."""

    own: tuple[Origin, ...] = ()

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
        return {effect.id: effect for effect in (*_ALL, *(origin.effect for origin in self.own))}

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
        """The candidates that can act on a rig of `kind`; `variants` with its own bounds or units take their place."""
        more = KINDS[kind].effects
        declared = {effect.id: effect for effect in self.candidates if kind in effect.kinds or effect.id in more}
        return tuple((declared | {variant.id: variant for variant in variants}).values())


CATALOGUE: Final = Catalogue()
"""The project's effects alone."""


def effect_words(name: str, catalogue: Mapping[str, type[Effect]] = CATALOGUE) -> str:
    """The name of an effect in words with an article; the id with blanks where the effect declares none."""
    declared = catalogue.get(name)
    return (declared.words if declared else "") or name.replace("_", " ")
