"""The catalogue of effects as Markdown, read from the effects' own declarations."""

import inspect
from collections.abc import Iterator, Mapping
from typing import Final

from models.effects import EFFECTS, REFINEMENTS
from models.effects.effect import Effect
from models.effects.equation import equations_of
from models.parameter import Parameter

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
    parts: list[str] = []
    for folder, title in GROUPS.items():
        parts += [f"## {title}", *(_effect(effect) for effect in EFFECTS if _folder(effect) == folder)]
    lines = ["| id | shape | refines |", "| --- | --- | --- |"]
    for effect in REFINEMENTS:
        owners = sorted(e.id for e in EFFECTS if effect.id in e.refined_by)
        lines.append(f"| `{effect.id}` | {effect.summary} | {', '.join(map(_link, owners))} |")
    return "\n\n".join([*parts, "## Refinements", "\n".join(lines)])


def _folder(effect: type[Effect]) -> str:
    return effect.__module__.split(".")[-2]


def _link(name: str) -> str:
    return f"[`{name}`](#{name})"


def _effect(effect: type[Effect]) -> str:
    lines = [f"### {effect.id}", "", f"{_sentence(effect.summary)} {_doc(effect)}", ""]
    lines += [*(f"    {equation}" for equation in equations_of(effect, digits=4)), ""]
    lines += [f"Kinds of rig: {', '.join(f'`{kind}`' for kind in sorted(effect.kinds))}.", ""]
    lines += ["| parameter | unit | range | start |", "| --- | --- | --- | --- |", *_parameters(effect), ""]
    known = {e.id for e in EFFECTS}
    if effect.confounders:
        alike = ", ".join(_link(name) if name in known else f"`{name}`" for name in effect.confounders)
        lines.append(f"Confounded with {alike}. Told apart by: {effect.separated_by}.")
    lines.append(f"Source: {effect.source}.")
    return "\n".join(lines)


def _parameters(effect: type[Effect]) -> Iterator[str]:
    for p in effect.parameters():
        yield f"| `{p.name}` | {p.unit} | {_bounds(p)} | {p.value:g} |"


def _bounds(parameter: Parameter) -> str:
    return f"{parameter.lower:g} to {parameter.upper:g}"


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _doc(effect: type[Effect]) -> str:
    return " ".join(inspect.cleandoc(effect.__doc__ or "").split()).replace("|", "\\|")
