"""The catalogue of effects as Markdown, read from the effects' own declarations."""

import inspect
from collections.abc import Mapping
from typing import Any, Final

from models.effects import EFFECTS, REFINEMENTS
from models.effects.effect import Effect
from models.effects.equation import ARGUMENTS, LEFT, SIGNALS, equations_of
from models.formula import written
from tests.hil.app.docs.markdown import markdown

GROUPS: Final[Mapping[str, str]] = {
    "friction": "Friction along the lumen",
    "force": "Forces on the capsule",
    "wall": "The wall",
    "drive": "The drive",
    "sensor": "The sensor",
    "inner_mass": "The inner mass of a vibro drive",
}


def catalogue() -> str:
    """All candidates of the search by where they act, then the refinements."""
    rows = (*LEFT.values(), *SIGNALS.values(), *ARGUMENTS.values())
    return markdown(
        "effects.md.j2",
        groups={
            title: [_record(e) for e in EFFECTS if e.__module__.split(".")[-1] == file]
            for file, title in GROUPS.items()
        },
        symbols=[*dict.fromkeys(tuple(row[:2]) for row in rows if row != SIGNALS["direction"])],
        known={effect.id for effect in EFFECTS},
        refinements=[(one, sorted(e.id for e in EFFECTS if one.id in e.refined_by)) for one in REFINEMENTS],
    )


def _record(effect: type[Effect]) -> dict[str, Any]:
    return {
        "declared": effect,
        "doc": " ".join(inspect.cleandoc(effect.__doc__ or "").split()).replace("|", "\\|"),
        "equations": [written(equation) for equation in equations_of(effect)],
        "kinds": sorted(effect.kinds),
        "parameters": effect.parameters(),
    }
