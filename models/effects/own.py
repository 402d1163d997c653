"""Effects from outside the project: classes in a user's file, or in an installed package under the entry point group
`capsule.effects`. A catalogue that holds them treats them like our own.
"""

from collections.abc import Collection, Container, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from models.effects.conformance import first_failure
from models.effects.effect import Effect
from models.files.python_file import classes_in, installed

GROUP: Final = "capsule.effects"


@dataclass(frozen=True)
class Origin:
    """An effect and its origin: name of file or package, SHA-256 of its content, the path by which to read it again."""

    effect: type[Effect]
    file: str
    sha256: str
    path: Path | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        if self.path is None:
            return Origin, (self.effect, self.file, self.sha256)
        return _read_again, (self.path, self.effect.id)


def _read_again(path: Path, name: str) -> Origin:
    return next(origin for origin in effects_in(path) if origin.effect.id == name)


def own_effects(paths: Sequence[Path], ours: Collection[str]) -> tuple[Origin, ...]:
    """The effects of `paths` and installed packages, of ids that none of `ours` has. Raises ValueError."""
    found = list(_found(paths))
    ids = {*ours, *(origin.effect.id for origin in found if isinstance(origin.effect.id, str))}
    taken = dict.fromkeys(ours, "the catalogue")
    for origin in found:
        name = origin.effect.id
        if isinstance(name, str) and name in taken:
            raise ValueError(f"{origin.file}: id must be one that is free; got {name!r}, which {taken[name]} has")
        failure = own_failure(origin.effect, ids)
        if failure is not None:
            raise ValueError(f"{origin.file}: {failure}")
        taken[name] = origin.file
    return tuple(found)


def own_failure(effect: type[Effect], known: Collection[str]) -> str | None:
    """The first rule that an effect from outside breaks, in a sentence; `known` are the ids in use."""
    if isinstance(effect.kinds, Container) and "vibro_table" in effect.kinds:
        return f"{effect.__name__}.kinds must not have 'vibro_table', whose effects have ranges of their own"
    return first_failure(effect, known)


def _found(paths: Sequence[Path]) -> Iterator[Origin]:
    for where, cls, digest in installed(GROUP, "effects"):
        if not issubclass(cls, Effect):
            raise ValueError(f"{where}: class must be a subclass of models.effects.effect.Effect; got {cls.__name__}")
        yield Origin(cls, where, digest)
    for path in paths:
        yield from effects_in(path)


def effects_in(path: Path) -> list[Origin]:
    """The effects that a Python file declares. Raises ValueError of one sentence where it cannot be run or has none."""
    declared, digest = classes_in(path, "effects")
    classes = [c for c in declared if issubclass(c, Effect) and (c.id or not c.__subclasses__())]
    if not classes:
        raise ValueError(f"{path}: file must have a subclass of models.effects.effect.Effect; got none")
    return [Origin(c, path.name, digest, path.resolve()) for c in classes]
