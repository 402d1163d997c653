"""Which effects a set of parameter values switches on."""

from __future__ import annotations

from collections.abc import Sequence

from models.effects.effect import Effect
from models.identification.kind import Theta


def parameters_of(effect: type[Effect], theta: Theta) -> dict[str, float] | None:
    """An effect's parameters in `theta`, at their defaults where left out; None where the effect is absent."""
    given = {p.name: theta[f"{effect.id}.{p.name}"] for p in effect.parameters() if f"{effect.id}.{p.name}" in theta}
    return {p.name: given.get(p.name, p.value) for p in effect.parameters()} if given else None


def present(effects: Sequence[type[Effect]], theta: Theta) -> list[tuple[Effect, dict[str, float]]]:
    """The effects in `theta`, each with its parameters."""
    return [(effect(), values) for effect in effects if (values := parameters_of(effect, theta)) is not None]
