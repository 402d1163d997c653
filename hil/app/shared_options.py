"""Options and arguments that several commands share, each declared once."""

import ast
import math
import re
import sys
import typing
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from models.files.access import opened
from models.words.sentences import Sentences

MOST_SEED = (1 << 63) - 1  # what a signed word of 64 bits holds
TEXT: Final = Sentences(__file__)
_STAGES = "nominal/calibrated/augmented"


def loaded(target: str) -> Callable[..., Any]:
    module, _, name = target.partition(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function


def declared(target: str, words: Mapping[str, str]) -> Callable[..., Any]:
    """The function `module:name`, which is imported once it is called: importing it takes seconds, and a missing file
    or an unknown option is said at once. Its parameters are read from the source, and may name what this module has;
    the help of each is its `words`.
    """
    module, _, name = target.partition(":")
    source = Path(str(getattr(find_spec(module), "origin", "")))
    found = next(n for n in ast.parse(source.read_bytes()).body if isinstance(n, ast.FunctionDef) and n.name == name)
    found.body, found.returns = [ast.parse(f"return _loaded({target!r})(**locals())").body[0]], None
    here = {**vars(typing), **vars(sys.modules[__name__]), "options": sys.modules[__name__], "_loaded": loaded}
    exec(compile(ast.fix_missing_locations(ast.Module([found], [])), str(source), "exec"), here)
    declaration: Callable[..., Any] = here[name]
    for parameter, said in words.items():
        declaration.__annotations__[parameter].__metadata__[0].help = said
    return declaration


def words_of(key: str) -> str:
    """What our sentences say of an option or argument that several commands share, "" of one that a single one has."""
    return TEXT(f"option.{key}") if f"option.{key}" in TEXT else ""


def option(name: str, metavar: str, reads: str = "", words: str = "") -> Any:
    """The option `--name METAVAR`; one that a single command has finds its words in `commands.toml`, others by their
    name or by `words` in `sentences.toml`. `reads`: what the file is that it names.
    """
    return typer.Option(name, metavar=metavar, help=words_of(words or name), callback=_readable(reads))


def _readable(what: str) -> Callable[[Any], Any] | None:
    """A look at the file or the files that a word names before anything large is loaded; None without `what`."""

    def look(value: Any) -> Any:
        for path in value if isinstance(value, (list, tuple)) else [value]:
            if path is not None and not Path(path).is_dir():
                opened(Path(path), what).close()
        return value

    return look if what else None


def seconds(text: str, name: str) -> float:
    """The time of the option `name`, such as `90s`, `5min` or `2h`, in s. Raises ValueError."""
    found = re.fullmatch(r"([0-9.]+(?:e[0-9]+)?) ?(s|min|h)", text)
    value = float(found[1]) * {"s": 1.0, "min": 60.0, "h": 3600.0}[found[2]] if found else math.nan
    if not 1.0 <= value <= 1e7:
        raise ValueError(f"{name} must be a number and s, min or h, as 90s or 5min, from 1s on; got {text!r}")
    return value


def several(name: str, metavar: str, taken_in: str = "", reads: str = "") -> Any:
    """An option that may be given several times; the function `taken_in` (`module:name`) reads it first."""

    def take_in(paths: list[Path]) -> list[Path]:
        if paths:
            loaded(taken_in)(paths)
        return paths

    use = take_in if taken_in else _readable(reads)
    more: dict[str, Any] = {"default_factory": list, "show_default": False, "callback": use}
    return typer.Option(name, metavar=metavar, help=words_of(name), **more)


def argument(metavar: str, reads: str = "") -> Any:
    """The argument METAVAR; its words and what it `reads` as those of `option`."""
    return typer.Argument(metavar=metavar, help=words_of(metavar), callback=_readable(reads))


Json = Annotated[bool, typer.Option("--json", help=words_of("--json"))]
RigFile = Annotated[Path, option("--rig", "RIG.toml", "rig file", "of_records")]
Records = Annotated[list[Path], argument("RECORD", "record")]
Learn = Annotated[bool, typer.Option("--learn", help=words_of("--learn"))]
Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, max=MOST_SEED, help=words_of("--seed"))]
RunSeed = Annotated[int | None, typer.Option("--seed", metavar="N", min=0, max=MOST_SEED, help=words_of("seed_of_run"))]
WorkerCount = Annotated[int | None, option("--workers", "N")]
Scheduler = Annotated[str | None, option("--scheduler", "ADDRESS")]
ControllerName = Annotated[str | None, option("--controller", "NAME")]
LearnedModel = Annotated[Path | None, option("--model", "MODEL.toml", "model")]
Stage = Annotated[str, option("--stage", _STAGES)]
StageOrScenario = Annotated[str | None, option("--stage", f"{_STAGES}/chosen", words="stage_or_chosen")]
OwnEffects = Annotated[list[Path], several("--effects", "FILE.py", reads="Python file with effects")]
OwnControllers = Annotated[list[Path], several("--controllers", "FILE.py", "controller.registry:use_controllers")]
ReferenceFile = Annotated[Path | None, option("--reference", "FILE.toml", "reference file")]
McapFile = Annotated[Path | None, option("--mcap", "FILE.mcap")]
