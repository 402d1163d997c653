"""The program `capsule`: one command a task; bad input ends with status 2 and one sentence on standard error.

A command's module is loaded by its name when it is called, so that `capsule --help` answers at once.
"""

import os
import re
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any

import typer
from threadpoolctl import threadpool_limits
from typer.core import TyperCommand

from hil.app.console import InterruptionError, printable
from hil.app.interruption import INTERRUPTED, INTERRUPTION
from hil.app.shared_options import (
    MOST_SEED,
    ControllerName,
    Json,
    Learn,
    LearnedModel,
    McapFile,
    OwnControllers,
    OwnEffects,
    Records,
    ReferenceFile,
    RigFile,
    RunSeed,
    Seed,
    Stage,
    StageOrScenario,
    argument,
    option,
    several,
)
from hil.app.write import file_trouble, own_folder
from models.parameter import nearest

BAD_INPUT = 2  # exit status
FILES = (
    "--out", "--rig", "--model", "--reference", "--holdout", "--log", "--mcap", "--plot", "--effects", "--controllers",
)  # fmt: skip

app = typer.Typer(
    name="capsule",
    help="Measured records of a capsule robot in, the effect that its model lacks out.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
Command = Callable[..., Any]


def _command(name: str, example: str, does: str | None = None, **options: Any) -> Callable[[Command], Command]:
    """Declare the command `name`, with an example at the end of its help. It `does` what the function `module:name`
    does with its options, by default that of its name; "": what the declaration does. The files of
    `controllers` are taken in before, those of `effects` become the catalogue that it gets.
    """
    function = f"hil.app.{name}.command:{name}" if does is None else does

    def declare(declaration: Command) -> Command:
        @wraps(declaration)
        def command(**given: Any) -> Any:
            if "controllers" in given:
                _loaded("controller.registry:use_controllers")(given["controllers"])
            if not function:
                return declaration(**given)
            if "effects" in given:
                given["effects"] = catalogue(given["effects"])
            return _loaded(function)(**{key: value for key, value in given.items() if key != "controllers"})

        return app.command(name, epilog=f"Example: {example}", **options)(command)

    return declare


def catalogue(paths: Sequence[Path]) -> Any:
    """The catalogue with the effects of the files `paths`."""
    return _loaded("models.effects:Catalogue.read")(paths)


def _loaded(place: str) -> Command:
    module, _, name = place.partition(":")
    function: Command = attrgetter(name)(import_module(module))
    return function


class ManyHoldouts(TyperCommand):
    """A command whose `--holdout` takes every word up to the next option, so that none of them becomes a training
    record.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat `--holdout` before each of its words, then parse as ever."""
        return super().parse_args(ctx, spread_option("--holdout", args))


def spread_option(option: str, args: Sequence[str]) -> list[str]:
    """`--holdout a b --json` as `--holdout a --holdout b --json`."""
    spread: list[str] = []
    waiting = within = False
    for word in args:
        if word == option:
            waiting = within = True
        elif word.startswith(f"{option}="):
            spread.append(word)
            waiting, within = False, True
        elif word.startswith("-") and word != "-":
            if waiting:
                spread.append(option)
            waiting = within = False
            spread.append(word)
        else:
            spread += [option, word] if within else [word]
            waiting = False
    return [*spread, option] if waiting else spread


def _show_version(wanted: bool) -> None:
    if wanted:
        try:
            number = version("capsule-control")
        except PackageNotFoundError:
            number = "not installed"
        typer.echo(f"capsule {number}")
        raise typer.Exit


@app.callback()
def _options(
    show: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@_command("seeds", "capsule seeds --plot papers", "hil.app.papers.command:seeds")
def _seeds(
    json_output: Json = False,
    plot: Annotated[Path | None, option("--plot", "DIR", "Draw the papers' figures into this folder.")] = None,
) -> None:
    """The seed papers' numbers: what each paper states, what its equations give here, what was measured."""


@_command("init", "capsule init magnetic my_rig", does="")
def _init(
    kind: Annotated[str, argument("KIND", "pull, magnetic, coil, vibro, vibro_table, axis, periods, friction or dma.")],
    folder: Annotated[Path, argument("DIR", "Folder for the files; made where there is none.")],
    rotary: Annotated[
        bool, typer.Option("--rotary", help="An axis that turns: angle, torque and inertia, in rad and N m.")
    ] = False,
    json_output: Json = False,
) -> None:
    """The first files of your own rig: a commented rig file, a template record, the command to run."""
    from hil.app.init.command import init

    with own_folder(folder, "DIR"):
        init(kind, folder, rotary=rotary, json_output=json_output)


@_command(
    "close-loop",
    "capsule close-loop run_1.csv run_2.csv --rig rig.toml --holdout run_3.csv --out out",
    "hil.app.identify.close_loop:close_loop",
    cls=ManyHoldouts,
)
def _close_loop(
    records: Annotated[
        list[Path], argument("RECORD...", "Training records: CSV, CAN logs, or files that convert reads.")
    ],
    rig: RigFile,
    out: Annotated[Path, option("--out", "DIR", "Folder for report, model and next experiment.")],
    holdout: Annotated[
        list[Path],
        several("--holdout", "RECORD...", "Records that no fit, search or threshold may touch."),
    ],
    *,
    json_output: Json = False,
    seed: Seed = 0,
    effects: OwnEffects,
) -> None:
    """Measured data -> residual -> missing effect -> better model."""


@_command("check", "capsule check run_1.csv run_2.csv --rig rig.toml")
def _check(records: Records, rig: RigFile, *, json_output: Json = False, effects: OwnEffects) -> None:
    """Records looked at before anything is fitted: findings, remedies, what they cannot show; status 1 where one
    stops a fit.
    """


@_command("effects", "capsule effects check my_effect.py")
def _effects(
    *,
    action: Annotated[
        str,
        argument(
            "[check/propose]",
            "check: run the conformance checks on a file of your own; propose: write what a report proposes for"
            " its residual as such a file.",
        ),
    ] = "list",
    file: Annotated[Path | None, argument("[FILE.py/DIR]", "The file to check, or the folder of the report.")] = None,
    own: OwnEffects,
    out: Annotated[Path | None, option("--out", "FILE.py", "Where propose writes the effect.")] = None,
    json_output: Json = False,
) -> None:
    """The catalogue: what a search can find; whether effects of your own keep to the rules; an effect that a report
    proposes.
    """


@_command("plot", "capsule plot run_1.csv run_2.csv --rig rig.toml --out records.html", "hil.app.plot:plot")
def _plot(
    records: Records,
    rig: Annotated[Path | None, option("--rig", "RIG.toml", "Its rig file; else all columns as they stand.")] = None,
    out: Annotated[Path, option("--out", "PAGE.html", "Where the page goes.")] = Path("records.html"),
    json_output: Json = False,
) -> None:
    """Pictures of records: a page with a panel for each column."""


@_command("convert", "capsule convert run_1.mf4 run_2.tdms converted/ --rig rig.toml")
def _convert(
    paths: Annotated[
        list[Path],
        argument("IN...", "CSV, TSV, Parquet, MF4, MCAP, ROS bag, TDMS, MATLAB, HDF5, or a CAN log of ours."),
    ],
    out: Annotated[
        str,
        argument(
            "OUT", "A file in .csv, .csv.gz, .parquet, .mf4 or .mcap; or a folder, there or ending in /, for CSV files."
        ),
    ],
    rig: Annotated[
        Path | None, option("--rig", "RIG.toml", "Read as its kind of rig and as its [columns]; else all channels.")
    ] = None,
    kind: Annotated[str | None, option("--kind", "KIND", "Read as a rig of this kind, without a rig file.")] = None,
    json_output: Json = False,
) -> None:
    """Files of other programs and CAN logs to CSV, Parquet, MF4 or MCAP."""


@_command(
    "predict",
    "capsule predict run_3.csv --rig rig.toml --model out/model.toml --out prediction.csv",
    "hil.app.identify.predict:predict",
)
def _predict(
    record: Annotated[Path, argument("RECORD", "A record; its measured columns may be missing.")],
    rig: RigFile,
    model: Annotated[Path, option("--model", "MODEL.toml", "A model that close-loop wrote.")],
    out: Annotated[Path, option("--out", "PRED.csv", "Where the prediction goes.")],
    *,
    stage: Stage = "augmented",
    json_output: Json = False,
    effects: OwnEffects,
) -> None:
    """Free-running prediction of the measured column from the driven column alone."""


@_command("export", "capsule export fmu hil/scenarios/sil_magnetic_drop.toml --out plant.fmu")
def _export(
    form: Annotated[str, argument("fmu/table/mujoco", "What to write.")],
    out: Annotated[Path, option("--out", "FILE/DIR", "An .fmu, an .xml for mujoco, a folder for table.")],
    *,
    scenario: Annotated[Path | None, argument("[SCENARIO.toml]", "The scenario whose plant becomes an FMU.")] = None,
    model: LearnedModel = None,
    rig: Annotated[Path | None, option("--rig", "RIG.toml", "The rig file that the model belongs to.")] = None,
    stage: Stage = "augmented",
    driven: Annotated[str, option("--driven", "COLUMN", "coil_voltage_V: a coil is commanded by its voltage.")] = "",
    json_output: Json = False,
    effects: OwnEffects,
) -> None:
    """A plant or a found model for other programs: an FMU (FMI 3.0), a friction table, a MuJoCo body."""


@_command(
    "simulate", "capsule simulate hil/scenarios/pull_over_folds.toml --out record.csv", "hil.app.simulate:simulate"
)
def _simulate(
    scenario: Annotated[Path, argument("SCENARIO.toml", "Rig, drive and hidden effects.")],
    out: Annotated[Path, option("--out", "RECORD.csv", "Where the record goes.")],
    json_output: Json = False,
) -> None:
    """The plant alone."""


@_command("design", "capsule design rig.toml --out design")
def _design(
    rig: Annotated[Path, argument("RIG.toml", "A rig of kind magnetic, coil or vibro.")],
    model: LearnedModel = None,
    stage: Stage = "augmented",
    out: Annotated[Path | None, option("--out", "DIR", "Draw the plots into this folder.")] = None,
    speed_mm_s: Annotated[float, option("--speed", "MM_S", "Speed in mm/s to linearise at.")] = 1.0,
    delay_ms: Annotated[float, option("--delay", "MS", "Age of a measurement in ms when the command acts.")] = 15.0,
    json_output: Json = False,
) -> None:
    """Linear design: gains, margins with delay, bandwidth, stick-slip cycles; for vibro resonance, gears and slow
    loop.
    """


@_command("track", "capsule track hil/scenarios/track_magnetic_ramp.toml --controller mpc --out out", does="")
def _track(
    scenario: Annotated[Path, argument("SCENARIO.toml", "Rig, reference, instruments and what is believed.")],
    *,
    controller: ControllerName = None,
    model: LearnedModel = None,
    stage: StageOrScenario = None,
    seed: RunSeed = None,
    reference: ReferenceFile = None,
    compare: Annotated[bool, typer.Option("--compare", help="Run every controller.")] = False,
    out: Annotated[Path | None, option("--out", "DIR", "Folder for track.html and track.json.")] = None,
    json_output: Json = False,
    effects: OwnEffects,
    controllers: OwnControllers,
) -> int:
    """Closed loop in simulation, no bus: reference tracking with a named controller; status 1 where a check of the
    scenario fails.
    """
    from hil.app.scenario.options import Options
    from hil.app.track.command import track

    with own_folder(out, "--out"):
        return track(
            scenario,
            Options(controller, model, stage, seed, out, json_output, reference, catalogue=catalogue(effects)),
            compare,
        )


@_command("sil", "capsule sil hil/scenarios/sil_magnetic_drop.toml --out out", does="")
def _sil(
    scenario: Annotated[Path, argument("SCENARIO.toml", "As for track, with [bus] and [[faults]].")],
    *,
    controller: ControllerName = None,
    model: LearnedModel = None,
    stage: StageOrScenario = None,
    seed: RunSeed = None,
    reference: ReferenceFile = None,
    out: Annotated[Path | None, option("--out", "DIR", "Folder for sil.json and the log frames.blf.")] = None,
    learn: Learn = False,
    mcap: McapFile = None,
    watch: Annotated[
        str | None, option("--watch", "CHANNEL", "In real time, its frames on this local bus: for cockpit.")
    ] = None,
    json_output: Json = False,
    effects: OwnEffects,
    controllers: OwnControllers,
) -> int:
    """Closed loop over the CAN bus in simulated time, plant as a bus node, with faults."""
    from hil.app.scenario.options import Options
    from hil.app.sil.command import sil

    with own_folder(out, "--out"):
        asked = Options(
            controller, model, stage, seed, out, json_output, reference, learn, mcap, watch, catalogue(effects)
        )
        return sil(scenario, asked)


@_command("run", "capsule run deployment.toml check")
def _run(
    path: Annotated[Path, argument("RIG.toml", "A rig file with [bus], [control], [reference] and [limits].")],
    *,
    action: Annotated[
        str, argument("check|reset", "check: look at all, send nothing; reset: acknowledge a latched fault, no more.")
    ] = "lead",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Listen and compute, send nothing.")] = False,
    log: Annotated[Path | None, option("--log", "LOG.blf", "Where the log goes; else beside you.")] = None,
    mcap: McapFile = None,
    reference: ReferenceFile = None,
    json_output: Json = False,
    effects: OwnEffects,
    controllers: OwnControllers,
    learn: Learn = False,
    move: Annotated[
        bool, typer.Option("--move", help="With check: lead the drive by 5 mm to and fro, and see the capsule answer.")
    ] = False,
) -> None:
    """The controller alone, on a real actuator bus."""


@_command(
    "plant",
    "capsule plant examples/deployment/deployment.toml --seconds 60",
    "hil.app.run.simulated_plant:plant",
)
def _plant(
    path: Annotated[Path, argument("DEPLOYMENT.toml", "A deployment file whose [plant] names a scenario.")],
    *,
    seconds: Annotated[float | None, option("--seconds", "S", "For how long; else until Ctrl-C.")] = None,
    lies: Annotated[
        list[str],
        several("--lie", "KIND[:TARGET][=VALUE][@S]", "What its localiser or drive lies about, and from when."),
    ],
    json_output: Json = False,
) -> None:
    """The simulated drive side alone, on the bus that the deployment file names; prints `ready` once it is there."""


@_command("cockpit", "capsule cockpit deployment.toml")
def _cockpit(
    path: Annotated[
        Path,
        argument(
            "DEPLOYMENT.toml | LOG | SCENARIO.toml",
            "A deployment file, whose bus is watched; a CAN log; or, with --watch, the scenario of a sil.",
        ),
    ],
    host: Annotated[
        str, option("--host", "ADDRESS", "Where to listen; else this machine alone can see it.")
    ] = "127.0.0.1",
    port: Annotated[int, option("--port", "N", "0: a free one.")] = 8420,
    watch: Annotated[
        str | None, option("--watch", "CHANNEL", "The local bus on which `capsule sil --watch` runs SOURCE.")
    ] = None,
    json_output: Json = False,
) -> None:
    """A page in the browser: a bus while it runs, or a log to scrub through; steers with the token that it prints."""


@_command("jog", "capsule jog examples/deployment/deployment.toml")
def _jog(
    path: Annotated[Path, argument("DEPLOYMENT.toml", "A deployment file with [operator] accept = true.")],
    source: Annotated[
        str, option("--source", "NAME", "Sender: keyboard, cockpit, joystick, ros, script, other.")
    ] = "keyboard",
    script: Annotated[
        str | None,
        option(
            "--script",
            "FILE",
            "Lines 'speed MM_S SECONDS', 'position MM SECONDS', 'release SECONDS' instead of keys; - for stdin.",
        ),
    ] = None,
    life_ms: Annotated[float, option("--life", "MS", "How long a setpoint counts; 1 to 200.")] = 100.0,
    json_output: Json = False,
) -> None:
    """Steer a controller that leads: the arrow keys while held, or a script."""


@_command("replay", "capsule replay run.blf", "hil.app.run.replay:replay")
def _replay(
    path: Annotated[Path, argument("LOG", "A log of the controller, its record beside it.")],
    *,
    json_output: Json = False,
    effects: OwnEffects,
    controllers: OwnControllers,
) -> None:
    """The controller again on a log: its frames compared bit by bit."""


@_command("campaign", "capsule campaign hil/scenarios/campaign_magnetic.toml --out out/campaign")
def _campaign(
    paths: Annotated[
        list[Path],
        argument(
            "CAMPAIGN.toml | FOLDER...",
            "A scenario and what is varied in it; or folders of series, rig.toml and records in each.",
        ),
    ],
    *,
    out: Annotated[Path, option("--out", "DIR", "Folder for results and report; resumed where it has some.")] = Path(
        "out/campaign"
    ),
    workers: Annotated[int | None, option("--workers", "N", "Processes; else one a core.")] = None,
    scheduler: Annotated[str | None, option("--scheduler", "ADDRESS", "A Dask scheduler to run on.")] = None,
    run: Annotated[int | None, option("--run", "N", "Do run N alone and print it.")] = None,
    json_output: Json = False,
    seed: Annotated[
        int, typer.Option("--seed", min=0, max=MOST_SEED, help="Of folders: sets every random number.")
    ] = 0,
    own: OwnEffects,
) -> None:
    """Thousands of closed loops: distributions and worst cases. Or close-loop on folders of series: what each rig
    lacks, how sure, how much better, which disagree.
    """


@_command("demo", "capsule demo --out out/demo")
def _demo(
    out: Annotated[Path, option("--out", "DIR", "Folder for the reports.")] = Path("out/demo"),
    json_output: Json = False,
    seed: Seed = 0,
) -> None:
    """The whole story in one go: drive, record, find what the model lacks, redeploy, compare."""


def one_thread() -> None:
    """Small matrices on one thread, here and in processes started from here: others would wait for a processor that the
    compiled loops of a search or other workers have, or that a control loop has at a higher priority.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    threadpool_limits(1)


def run(args: Sequence[str]) -> int:
    """Run one command line and return its exit status."""
    one_thread()
    for before, word in pairwise(("capsule", *args)):
        if word.removesuffix("=") in FILES and word.endswith("="):
            return _said(f"{word[:-1]} must name a file or a folder; got nothing", BAD_INPUT)
        if not word and (before in FILES or not before.startswith("-")):
            what = before if before in FILES else f"what follows {before[:60]!r}"
            return _said(f"{what} must name a file or a folder; got nothing", BAD_INPUT)
    try:
        status = app(list(args) or ["--help"], prog_name="capsule", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        return _said(INTERRUPTION, INTERRUPTED)
    except InterruptionError as error:
        return _said(str(error), INTERRUPTED)
    except typer.TyperException as error:
        return _said(_usage(error, args), BAD_INPUT)
    except OSError as error:
        return _said(file_trouble(error), BAD_INPUT)
    except ValueError as error:
        if os.environ.get("CAPSULE_TRACEBACK"):
            raise
        return _said(str(error), BAD_INPUT, getattr(error, "__notes__", ()))
    if status == INTERRUPTED:
        return _said(INTERRUPTION, INTERRUPTED)
    return status if isinstance(status, int) else 0


def _usage(error: typer.TyperException, args: Sequence[str]) -> str:
    format_message = getattr(error, "format_message", None)
    message = (format_message() if format_message else str(error)).rstrip(".")
    wrong = re.fullmatch(r"Invalid value for '(.+?)': Input should be (.+?)(?:, unable to .*)?", message)
    if wrong:
        given = next((word for before, word in pairwise(args) if before == wrong[1]), "")
        message = f"{wrong[1]} must be {wrong[2]}" + (f"; got {given[:60]!r}" if given else "")
    commands = [command.name or "" for command in app.registered_commands]
    if args[0] in commands:
        return f"{message}; see 'capsule {args[0]} --help'"
    return f"{message.split('. Did you')[0]}; {nearest(args[0], commands)}"


def _said(sentence: str, status: int, pasted: Sequence[str] = ()) -> int:
    """Print a sentence, and below it what may be pasted into a file; the status."""
    print("capsule:", printable(" ".join(sentence.split())), file=sys.stderr)
    for text in pasted:
        print(printable(text), file=sys.stderr)
    return status
