"""`capsule effects`: what the search can find, and whether a user's own effects keep to the rules."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from rich.table import Table

from hil.app.console import answer, text_table
from hil.app.propose import TEXT, propose
from hil.app.shared_options import Json, OwnEffects, argument, option
from models.effects import CATALOGUE, Catalogue, effect_words
from models.effects.conformance import CHECKS
from models.effects.effect import Effect
from models.effects.equation import text_of
from models.parameter import nearest


def effects(
    *,
    action: Annotated[
        str,
        argument(
            "check|propose",
            "check: run the conformance checks on a file of your own; propose: write what a report proposes for"
            " its residual as such a file.",
        ),
    ] = "list",
    file: Annotated[Path | None, argument("FILE.py|DIR", "The file to check, or the folder of the report.")] = None,
    own: OwnEffects,
    out: Annotated[Path | None, option("--out", "FILE.py", "Where propose writes the effect.")] = None,
    json_output: Json = False,
) -> None:
    """List the catalogue, run the conformance checks on a file of effects, or write what a report proposes."""
    if (action == "propose") != (out is not None) or (action == "propose" and file is None):
        raise ValueError(f"--out FILE.py must stand with propose DIR alone; got {action}, {file or 'no folder'}")
    if file is not None and out is not None:
        propose(file, out, json_output=json_output)
        return
    if action not in ("list", "check"):
        raise ValueError(
            f"action must be list, check or propose; got {action!r}; {nearest(action, ('list', 'check', 'propose'))}"
        )
    if (file is None) == (action == "check"):
        raise ValueError(f"a file must stand with check alone; got {file or 'none'}")
    catalogue = Catalogue.read([file] if file is not None else own)
    if action == "list":
        found = list(catalogue.candidates)
        document: dict[str, Any] = {"effects": [described(effect) for effect in found]}
    else:
        found = [origin.effect for origin in catalogue.own if file is not None and origin.file == file.name]
        checked = [{"id": effect.id, "checks": list(CHECKS), "passed": True} for effect in found]
        document = {"file": str(file), "effects": checked}
    count, checks = len(CHECKS), ", ".join(CHECKS)
    passed = (TEXT("effects.passed", effect=effect.id, count=count, checks=checks) for effect in found)
    answer(json_output, document, *([_table(found)] if action == "list" else passed))


def described(effect: type[Effect]) -> dict[str, Any]:
    return {
        "id": effect.id,
        "name": effect_words(effect.id, {effect.id: effect}),
        "summary": effect.summary,
        "equation": text_of(effect),
        "kinds": sorted(effect.kinds),
        "parameters": [
            {"name": p.name, "unit": p.unit, "value": p.value, "lower": p.lower, "upper": p.upper, "source": p.source}
            for p in effect.parameters()
        ],
        "confounders": [name for name in effect.confounders if name in CATALOGUE],
        "separated_by": effect.separated_by,
        "source": effect.source,
    }


def _table(found: Sequence[type[Effect]]) -> Table:
    heads = ("id", "what it is", "kinds of rig", "confounded with")
    table = text_table(TEXT("effects.title"), heads, heads)
    for effect in found:
        table.add_row(effect.id, effect.summary, ", ".join(sorted(effect.kinds)), ", ".join(effect.confounders))
    return table
