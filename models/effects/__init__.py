"""What a rig may have beyond the base model: one file an effect, found in the folders below.

A class in `friction/`, `force/`, `wall/`, `drive/`, `sensor/` or `inner_mass/` is a candidate of the search; one in
`refinements/` gives the shape of an effect that is already named more freedom and is never a candidate by itself.
"""

import pkgutil
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Final

from models.effects import own
from models.effects.effect import Effect
from models.parameter import Name
from models.rigs.kinds import KINDS

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
BY_ID = {effect.id: effect for effect in _ALL}


def effects_for(kind: str, variants: Sequence[type[Effect]] = ()) -> tuple[type[Effect], ...]:
    """The candidates that can act on a rig of `kind`, ours and those from outside; `variants` stand in place of those
    of the same id: the same law with bounds, starts or units of that kind.
    """
    outside = (origin.effect for origin in own.LOADED.values())
    more = KINDS[kind].effects
    declared = {effect.id: effect for effect in (*EFFECTS, *outside) if kind in effect.kinds or effect.id in more}
    return tuple((declared | {variant.id: variant for variant in variants}).values())


def followed_by(state: Name) -> str:
    """What a model's state is at after a long rest: "command", "position", or "" for 0."""
    effect = None if isinstance(state, str) else BY_ID.get(state[0])
    return "" if effect is None else effect.follows.get(state[1], "")


def use_effects(paths: Sequence[Path]) -> list[type[Effect]]:
    """Let the effects of the Python files `paths`, and those of installed packages, take part from here on, in place of
    those of an earlier call. Raises ValueError of one sentence, and uses none, where one cannot be used.
    """
    return own.use(paths, BY_ID)
