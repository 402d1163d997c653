"""Controllers from outside: classes in a user's file or in a package (entry point group `capsule.controllers`)."""

import inspect
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Final

from controller.drives import DRIVES
from controller.signals import Controller
from models.files.python_file import classes_in, installed

GROUP: Final = "capsule.controllers"


def own_controllers(paths: Sequence[Path], taken: Collection[str]) -> dict[str, type[Controller]]:
    """The controllers of the files `paths` and of installed packages by name; none may be one of those `taken`. Raises
    ValueError, one sentence with the file, where one cannot be used.
    """
    found: dict[str, type[Controller]] = {}
    for where, cls in _declared(paths):
        failure = _failure(cls, {*taken, *found})
        if failure is not None:
            raise ValueError(f"{where}: {failure}")
        found[cls.name] = cls
    return found


def _declared(paths: Sequence[Path]) -> Iterator[tuple[str, type[Controller]]]:
    for where, cls, _ in installed(GROUP, "controllers"):
        yield where, cls
    for path in paths:
        classes = [c for c in classes_in(path, "controllers")[0] if Controller in c.__mro__]
        if not classes:
            raise ValueError(f"{path}: file must have a subclass of controller.signals.Controller; got none")
        yield from ((str(path), cls) for cls in classes)


def _failure(cls: type[Controller], taken: Collection[str]) -> str | None:
    name, kinds = getattr(cls, "name", ""), getattr(cls, "kinds", ())
    if not isinstance(name, str) or not name.isidentifier():
        return f"{cls.__name__}.name must be letters, digits and underscores; got {name!r}"
    if name in taken:
        return f"{cls.__name__}.name must be one that is free; got {name!r}"
    if not isinstance(kinds, tuple) or not kinds or not set(kinds) <= set(DRIVES):
        return f"{cls.__name__}.kinds must be some of {', '.join(DRIVES)} in a tuple; got {kinds!r}"
    if list(inspect.signature(cls).parameters) != ["model", "envelope"]:
        return f"{cls.__name__} must be made from (model, envelope); got {inspect.signature(cls)}"
    wanted = list(inspect.signature(Controller.act).parameters)
    got = list(inspect.signature(cls.act).parameters)
    return None if got == wanted else f"{cls.__name__}.act must take ({', '.join(wanted)}); got ({', '.join(got)})"
