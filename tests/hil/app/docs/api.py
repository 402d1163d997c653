"""The reference of the Python API as Markdown, read from the signatures and docstrings of `hil.api`."""

import inspect
import re
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, Final

MODULE: Final = "hil.api"
_WIDEST: Final = 100  # characters of a signature on one line
_QUOTED: Final = re.compile(r"(: |-> )'([^']*)'")
"""An annotation that is kept as text."""
_MODULE: Final = re.compile(r"\b(?:[a-z_]+\.)+(?=[A-Z])")
"""Where a class of an annotation stands."""


def reference() -> str:
    """Every public function and record of `hil.api`; a sentence where this version has none."""
    return described(import_module(MODULE)) if find_spec(MODULE) else "This version has no Python API yet."


def described(module: ModuleType) -> str:
    """The public functions and classes of a module in the order of `__all__`, else of their definition."""
    defined = [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", "") == module.__name__ and callable(value)
    ]
    names = [str(name) for name in getattr(module, "__all__", defined)]
    parts = [_entry(name, getattr(module, name)) for name in names if callable(getattr(module, name))]
    return "\n\n".join([inspect.cleandoc(module.__doc__ or ""), *parts])


def _entry(name: str, value: Any) -> str:
    text = inspect.cleandoc(value.__doc__ or "")
    signature = _MODULE.sub("", _QUOTED.sub(r"\1\2", _signature(name, value)))
    return f"## {name}\n\n```python\n{signature}\n```\n\n{text}"


def _signature(name: str, value: Any) -> str:
    """The signature on one line, or a parameter a line where it would be too long."""
    signature = inspect.signature(value)
    if len(line := f"{name}{signature}") <= _WIDEST:
        return line
    parameters = [f"    {parameter}," for parameter in _written(signature)]
    bare = inspect.isclass(value) or signature.return_annotation is signature.empty
    arrow = "" if bare else f" -> {inspect.formatannotation(signature.return_annotation)}"
    return "\n".join([f"{name}(", *parameters, f"){arrow}"])


def _written(signature: inspect.Signature) -> list[str]:
    """The parameters as they are written, with the star before those that must be named."""
    written: list[str] = []
    starred = False
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.VAR_POSITIONAL:
            starred = True
        if parameter.kind is parameter.KEYWORD_ONLY and not starred:
            written.append("*")
            starred = True
        written.append(str(parameter))
    return written
