"""Checks of an effect's declarations: known names, values of the right type, hooks of the right signature."""

import inspect
import math
import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any, Final

from models.effects.effect import HOOKS, NEEDS, Effect, InnerMassEffect
from models.files.units import unit
from models.parameter import Parameter, nearest

_TUPLES: Final = ("states", "confounders", "refined_by", "needs", "proposed_on")
_WORDS: Final = ("id", "words", "summary", "source", "separated_by", "of", "behind")
DECLARATIONS: Final = (*_WORDS, "kinds", *_TUPLES, "symbols", "follows", "grid", "probe", "by_speed", "exact", "forms")
"""What an effect may declare in addition to its parameters and hooks."""
_OURS: Final = (*DECLARATIONS, "parameters")
_OWN_HOOKS: Final = ("suspension", "reach")
_UNITS: Final = ("kg", "K", "J", "W", "T", "C", "F", "H", "ohm", "degC", "Wb", "or", "at")
_RELATIVE: Final = ("command", "measured unit")
"""What a unit may be stated in terms of."""


def declared(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """declarations"""
    values = {key: getattr(effect, key) for key in DECLARATIONS}
    if not isinstance(effect.id, str) or not effect.id.isidentifier() or effect.id != effect.id.lower():
        yield f".id must be lower-case letters, digits and underscores; got {effect.id!r}"
    for loose in (key for key in _WORDS if not isinstance(values[key], str)):
        yield f".{loose} must be text; got {values[loose]!r}"
    if not effect.summary:
        yield ".summary must say in a few words what the effect is; got none"
    if not isinstance(effect.kinds, frozenset | set):
        yield f".kinds must be a set of kinds of rig, such as frozenset({{'pull'}}); got {effect.kinds!r}"
    names = {key for key in _TUPLES if isinstance(values[key], tuple) and all(isinstance(v, str) for v in values[key])}
    for loose in (key for key in _TUPLES if key not in names):
        yield f".{loose} must be a tuple of names, such as ('a',); got {values[loose]!r}"
    if not isinstance(effect.by_speed, bool):
        yield f".by_speed must be True or False; got {effect.by_speed!r}"
    values["of"] = (effect.of,) if effect.of else ()
    for key, choices in (("confounders", known), ("refined_by", known), ("of", known), ("needs", NEEDS)):
        for strange in sorted(set(values[key]) - set(choices)):
            what = "among its choices" if key == "needs" else "ids of known effects"
            yield f".{key} must be {what}; got {strange!r}; {nearest(strange, list(choices))}"
    if not isinstance(effect.symbols, Mapping) or not all(isinstance(one, str) for one in effect.symbols.values()):
        yield f".symbols must map parameters and states to letters; got {effect.symbols!r}"
    if not isinstance(effect.follows, Mapping) or not set(effect.follows) <= set(effect.states):
        yield f".follows must map states to 'command' or 'position'; got {effect.follows!r}"
    for wrong in sorted(str(value) for value in effect.follows.values() if value not in ("command", "position")):
        yield f".follows must map states to 'command' or 'position'; got {wrong!r}"


def of_parameters(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """parameters"""
    for key, value in _own(effect).items():
        if isinstance(value, Parameter) and value.name != key:
            yield f".{key} must have a parameter of the same name; got {value.name!r}"
    parameters = effect.parameters()
    if not parameters:
        yield " must have a parameter, its amplitude first; got none"
    yield from (f".{p.name} {wrong}" for p in parameters if (wrong := _wrong(p)) is not None)
    amplitude = effect.amplitude()
    if amplitude.value != 0.0 or not amplitude.fit:
        yield f".{amplitude.name}, the amplitude, must start at 0 and be fitted; got {amplitude.value:g}"
    if not _is_number(effect.probe) or effect.probe == 0 or not amplitude.lower <= effect.probe <= amplitude.upper:
        yield f".probe must be an amplitude within its bounds and not 0; got {effect.probe!r}"
    bounds = {p.name: p for p in parameters}
    if not isinstance(effect.grid, Mapping):
        yield f".grid must map parameters to tuples of starts; got {effect.grid!r}"
    for key, starts in effect.grid.items():
        if key not in bounds:
            yield f".grid must name parameters; got {key!r}; {nearest(str(key), list(bounds))}"
        p = bounds[key]
        inside = isinstance(starts, tuple) and starts and all(_is_number(x) and p.lower <= x <= p.upper for x in starts)
        if not inside:
            yield f".grid must have starts of {key} in [{p.lower:g}, {p.upper:g}]; got {starts!r}"


def _wrong(p: Parameter) -> str | None:
    """What is wrong with a parameter."""
    finite = all(_is_number(x) and math.isfinite(x) for x in (p.value, p.lower, p.upper))
    if not finite or p.lower >= p.upper:
        return f"must have finite bounds, the lower below the upper; got {p.lower}, {p.upper}"
    if not (_is_number(p.spread) and _is_number(p.least) and p.spread > 0) or not 0 <= p.least < max(-p.lower, p.upper):
        return f"must have a spread above 0 and a least size within its bounds; got {p.spread}, {p.least}"
    if p.role not in ("", "phase", "place"):
        return f"must have the role 'phase', 'place' or none; got {p.role!r}"
    if not _is_unit(p.unit):
        return f"must have a unit, such as N, m/s or 1; got {p.unit!r}"
    return None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value)


def _is_unit(text: Any) -> bool:
    """Whether a text is a unit: 1, one in terms of the command or the reading, or a product of known symbols."""
    if not isinstance(text, str) or text == "1" or any(word in text for word in _RELATIVE):
        return isinstance(text, str)
    symbols = re.findall(r"[^\W\d_]+", text)
    return bool(symbols) and all(s in _UNITS or unit(s) is not None for s in symbols)


def hooked(effect: type[Effect], known: Collection[str]) -> Iterator[str]:
    """signatures"""
    inner = issubclass(effect, InnerMassEffect)
    for key, value in _own(effect).items():
        if key in HOOKS:
            if key in _OWN_HOOKS and not inner:
                yield f" must be a subclass of InnerMassEffect to define {key!r}; got one of Effect"
            if not inspect.isfunction(value):
                yield f".{key} must be a method; got {value!r}"
            wanted, got = (list(inspect.signature(f).parameters) for f in (HOOKS[key], value))
            if wanted != got:
                yield f".{key} must take ({', '.join(wanted)}); got ({', '.join(got)})"
        elif key not in _OURS and not isinstance(value, Parameter):
            what, choices = ("hook", tuple(HOOKS)) if inspect.isroutine(value) else ("declaration", DECLARATIONS)
            hint = nearest(key, choices)
            yield f".{key} must be a {what}, or begin with an underscore where it is its own; {hint}"


def _own(effect: type[Effect]) -> dict[str, Any]:
    """What `effect` has of its own, and of bases below ours, by its public names."""
    own: dict[str, Any] = {}
    for c in reversed([c for c in effect.__mro__ if issubclass(c, Effect) and c not in (Effect, InnerMassEffect)]):
        own |= dict.fromkeys(inspect.get_annotations(c)) | vars(c)
    return {key: value for key, value in own.items() if not key.startswith("_")}
