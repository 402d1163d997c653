"""Options and arguments that several commands share, each declared once."""

import math
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

MOST_SEED = (1 << 63) - 1  # what a signed word of 64 bits holds
_STAGES = "nominal/calibrated/augmented"


def loaded(target: str) -> Callable[..., Any]:
    """The function `module:name`."""
    module, _, name = target.partition(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function


def option(name: str, metavar: str, words: str) -> Any:
    """The option `--name METAVAR` with its `words` in the help."""
    return typer.Option(name, metavar=metavar, help=words)


def seconds(text: str, name: str) -> float:
    """The time of the option `name`, such as `90s`, `5min` or `2h`, in s. Raises ValueError."""
    found = re.fullmatch(r"([0-9.]+(?:e[0-9]+)?) ?(s|min|h)", text)
    value = float(found[1]) * {"s": 1.0, "min": 60.0, "h": 3600.0}[found[2]] if found else math.nan
    if not 1.0 <= value <= 1e7:
        raise ValueError(f"{name} must be a number and s, min or h, as 90s or 5min, from 1s on; got {text!r}")
    return value


def several(name: str, metavar: str, words: str, taken_in: str = "") -> Any:
    """An option that may be given several times; the function `taken_in` (`module:name`) reads it first."""

    def take_in(paths: list[Path]) -> list[Path]:
        loaded(taken_in)(paths)
        return paths

    use = take_in if taken_in else None
    return typer.Option(name, metavar=metavar, help=words, default_factory=list, show_default=False, callback=use)


def argument(metavar: str, words: str) -> Any:
    """The argument METAVAR with its `words` in the help."""
    return typer.Argument(metavar=metavar, help=words)


Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else there.")]
RigFile = Annotated[Path, option("--rig", "RIG.toml", "The rig file with the nominal values.")]
Records = Annotated[list[Path], argument("RECORD...", "Records of one rig.")]
Learn = Annotated[
    bool, typer.Option("--learn", help="When the model breaks, identify in the background and use a model that passes.")
]
Seed = Annotated[int, typer.Option("--seed", min=0, max=MOST_SEED, help="Sets every random number.")]
RunSeed = Annotated[
    int | None, typer.Option("--seed", min=0, max=MOST_SEED, help="Sets every random number; else the scenario's.")
]
WorkerCount = Annotated[int | None, option("--workers", "N", "Number of processes; else one per core.")]
Scheduler = Annotated[str | None, option("--scheduler", "ADDRESS", "A Dask scheduler to run on.")]
ControllerName = Annotated[str | None, option("--controller", "NAME", "Which controller.")]
LearnedModel = Annotated[Path | None, option("--model", "MODEL.toml", "A model that close-loop wrote.")]
Stage = Annotated[str, option("--stage", _STAGES, "Which model.")]
StageOrScenario = Annotated[
    str | None, option("--stage", f"{_STAGES}/chosen", "Which model; chosen: what is expected to track best.")
]
OwnEffects = Annotated[list[Path], several("--effects", "FILE.py", "Effects of your own; may be given several times.")]
OwnControllers = Annotated[
    list[Path],
    several(
        "--controllers",
        "FILE.py",
        "Controllers of your own; may be given several times.",
        "controller.registry:use_controllers",
    ),
]
ReferenceFile = Annotated[
    Path | None,
    option("--reference", "FILE.toml", "Reference in place of its own: next_experiment.toml of close-loop."),
]
McapFile = Annotated[
    Path | None, option("--mcap", "FILE.mcap", "Signals of the bus as MCAP, beside the log, while it runs.")
]
