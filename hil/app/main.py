"""The program `capsule`: one command a task; bad input ends with status 2 and one sentence on standard error.

A command's module is imported when it is called, so that `capsule --help` answers at once.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer
from threadpoolctl import threadpool_limits
from typer.core import TyperCommand

from hil.app.console import InterruptionError, output_to_notes, print_json, printable, summary
from hil.app.interruption import INTERRUPTED, INTERRUPTION
from hil.app.write import file_trouble, own_folder
from models.parameter import nearest

BAD_INPUT = 2
FILES = (
    "--out",
    "--rig",
    "--model",
    "--reference",
    "--holdout",
    "--log",
    "--mcap",
    "--plot",
    "--effects",
    "--controllers",
)
MOST_SEED = (1 << 63) - 1

app = typer.Typer(
    name="capsule",
    help="Measured records of a capsule robot in, the effect that its model lacks out.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
Learn = Annotated[
    bool, typer.Option("--learn", help="Once the model breaks, identify in the background and take what passes.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else there.")]
RigFile = Annotated[
    Path, typer.Option("--rig", metavar="RIG.toml", help="What the experimenter believes about the rig.")
]
Seed = Annotated[int, typer.Option("--seed", min=0, max=MOST_SEED, help="Sets every random number.")]
ControllerName = Annotated[str | None, typer.Option("--controller", metavar="NAME", help="Which controller.")]
LearnedModel = Annotated[
    Path | None, typer.Option("--model", metavar="MODEL.toml", help="A model that close-loop wrote.")
]
ModelStage = Annotated[str | None, typer.Option("--stage", metavar="nominal/calibrated/augmented", help="Which model.")]
OwnEffects = Annotated[
    list[Path] | None,
    typer.Option("--effects", metavar="FILE.py", help="Effects of your own; may be given several times."),
]
OwnControllers = Annotated[
    list[Path] | None,
    typer.Option("--controllers", metavar="FILE.py", help="Controllers of your own; may be given several times."),
]
ReferenceFile = Annotated[
    Path | None,
    typer.Option(
        "--reference", metavar="FILE.toml", help="Where to go, instead of its own: next_experiment.toml of close-loop."
    ),
]
McapFile = Annotated[
    Path | None, typer.Option("--mcap", metavar="FILE.mcap", help="The bus's signals as MCAP, too, while it runs.")
]
RunSeed = Annotated[
    int | None, typer.Option("--seed", min=0, max=MOST_SEED, help="Sets every random number; else the scenario's.")
]


def _command(name: str, example: str, **options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Declare the command `name`, with an example at the end of its help."""
    return app.command(name, epilog=f"Example: {example}", **options)


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


@_command("seeds", "capsule seeds --plot papers")
def _seeds(
    json_output: Json = False,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="DIR", help="Draw the papers' figures into this folder.")
    ] = None,
) -> None:
    """The seed papers' numbers: what each paper states, what its equations give here, what was measured."""
    from hil.app.papers import seeds

    seeds(json_output=json_output, plot=plot)


@_command("init", "capsule init magnetic my_rig")
def _init(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND", help="pull, magnetic, coil, vibro, vibro_table, axis, periods, friction or dma."
        ),
    ],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the files; made where there is none.")],
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
    cls=ManyHoldouts,
)
def _close_loop(
    records: Annotated[
        list[Path],
        typer.Argument(metavar="RECORD...", help="Training records: CSV, CAN logs, or files that convert reads."),
    ],
    rig: RigFile,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="Folder for report, model and next experiment."),
    ],
    holdout: Annotated[
        list[Path] | None,
        typer.Option("--holdout", metavar="RECORD...", help="Records that no fit, search or threshold may touch."),
    ] = None,
    json_output: Json = False,
    seed: Seed = 0,
    effects: OwnEffects = None,
) -> None:
    """Measured data -> residual -> missing effect -> better model."""
    from hil.app.identify.close_loop import close_loop
    from models.effects import use_effects

    use_effects(effects or [])
    close_loop(records, rig, out, holdout or [], json_output=json_output, seed=seed)


@_command("check", "capsule check run_1.csv run_2.csv --rig rig.toml")
def _check(
    records: Annotated[list[Path], typer.Argument(metavar="RECORD...", help="Records of one rig.")],
    rig: RigFile,
    json_output: Json = False,
    effects: OwnEffects = None,
) -> int:
    """Records looked at before anything is fitted: findings, remedies, what they cannot show; status 1 where one
    stops a fit.
    """
    from hil.app.check.command import check
    from models.effects import use_effects

    use_effects(effects or [])
    return check(records, rig, json_output=json_output)


@_command("effects", "capsule effects check my_effect.py")
def _effects(
    action: Annotated[
        str,
        typer.Argument(
            metavar="[check/propose]",
            help="check: run the conformance checks on a file of your own; propose: write what a report proposes for"
            " its residual as such a file.",
        ),
    ] = "list",
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE.py/DIR]", help="The file to check, or the folder of the report.")
    ] = None,
    effects: OwnEffects = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.py", help="Where propose writes the effect.")
    ] = None,
    json_output: Json = False,
) -> None:
    """The catalogue: what a search can find; whether effects of your own keep to the rules; an effect that a report
    proposes.
    """
    from hil.app.effects.command import effects as command
    from hil.app.effects.propose import propose

    if (action == "propose") != (out is not None) or (action == "propose" and file is None):
        raise ValueError(f"--out FILE.py must stand with propose DIR alone; got {action}, {file or 'no folder'}")
    if action == "propose" and file is not None and out is not None:
        propose(file, out, json_output=json_output)
    else:
        command(action, file, effects or [], json_output=json_output)


@_command("plot", "capsule plot run_1.csv run_2.csv --rig rig.toml --out records.html")
def _plot(
    records: Annotated[list[Path], typer.Argument(metavar="RECORD...", help="Records of one rig.")],
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="RIG.toml", help="Its rig file; else all columns as they stand."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="PAGE.html", help="Where the page goes.")] = Path(
        "records.html"
    ),
    json_output: Json = False,
) -> None:
    """Pictures of records: a page with a panel for each column."""
    from hil.app.plot.command import plot

    plot(records, rig, out, json_output=json_output)


@_command("convert", "capsule convert run_1.mf4 run_2.tdms converted/ --rig rig.toml")
def _convert(
    records: Annotated[
        list[Path],
        typer.Argument(
            metavar="IN...", help="CSV, TSV, Parquet, MF4, MCAP, ROS bag, TDMS, MATLAB, HDF5, or a CAN log of ours."
        ),
    ],
    out: Annotated[
        str,
        typer.Argument(
            metavar="OUT",
            help="A file in .csv, .csv.gz, .parquet, .mf4 or .mcap; or a folder, there or ending in /, for CSV files.",
        ),
    ],
    rig: Annotated[
        Path | None,
        typer.Option(
            "--rig", metavar="RIG.toml", help="Read as its kind of rig and as its [columns]; else all channels."
        ),
    ] = None,
    kind: Annotated[
        str | None, typer.Option("--kind", metavar="KIND", help="Read as a rig of this kind, without a rig file.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Files of other programs and CAN logs to CSV, Parquet, MF4 or MCAP."""
    from hil.app.convert.command import convert

    convert(records, out, rig, kind, json_output=json_output)


@_command("predict", "capsule predict run_3.csv --rig rig.toml --model out/model.toml --out prediction.csv")
def _predict(
    record: Annotated[Path, typer.Argument(metavar="RECORD", help="A record; its measured columns may be missing.")],
    rig: RigFile,
    model: Annotated[Path, typer.Option("--model", metavar="MODEL.toml", help="A model that close-loop wrote.")],
    out: Annotated[Path, typer.Option("--out", metavar="PRED.csv", help="Where the prediction goes.")],
    stage: Annotated[
        str, typer.Option("--stage", metavar="nominal/calibrated/augmented", help="Which model.")
    ] = "augmented",
    json_output: Json = False,
    effects: OwnEffects = None,
) -> None:
    """Free-running prediction of the measured column from the driven column alone."""
    from hil.app.identify.predict import predict
    from models.effects import use_effects

    use_effects(effects or [])
    predict(record, rig, model, out, stage=stage, json_output=json_output)


@_command("export", "capsule export fmu hil/scenarios/sil_magnetic_drop.toml --out plant.fmu")
def _export(
    form: Annotated[str, typer.Argument(metavar="fmu/table/mujoco", help="What to write.")],
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE/DIR", help="An .fmu, an .xml for mujoco, a folder for table.")
    ],
    scenario: Annotated[
        Path | None, typer.Argument(metavar="[SCENARIO.toml]", help="The scenario whose plant becomes an FMU.")
    ] = None,
    model: LearnedModel = None,
    rig: Annotated[
        Path | None, typer.Option("--rig", metavar="RIG.toml", help="The rig file that the model belongs to.")
    ] = None,
    stage: Annotated[
        str, typer.Option("--stage", metavar="nominal/calibrated/augmented", help="Which model.")
    ] = "augmented",
    driven: Annotated[
        str, typer.Option("--driven", metavar="COLUMN", help="coil_voltage_V: a coil is commanded by its voltage.")
    ] = "",
    json_output: Json = False,
    effects: OwnEffects = None,
) -> None:
    """A plant or a found model for other programs: an FMU (FMI 3.0), a friction table, a MuJoCo body."""
    from hil.app.export.command import Asked, export
    from models.effects import use_effects

    use_effects(effects or [])
    export(Asked(form, scenario, model, rig, out, stage, driven), json_output=json_output)


@_command("simulate", "capsule simulate hil/scenarios/pull_over_folds.toml --out record.csv")
def _simulate(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="Rig, drive and hidden effects.")],
    out: Annotated[Path, typer.Option("--out", metavar="RECORD.csv", help="Where the record goes.")],
    json_output: Json = False,
) -> None:
    """The plant alone."""
    from hil.app.simulate import simulate

    with output_to_notes():
        simulate(scenario, out)
    if json_output:
        print_json({"scenario": str(scenario), "record": str(out)})
    else:
        summary().print(f"record: {out}", markup=False, soft_wrap=True)


@_command("design", "capsule design rig.toml --out design")
def _design(
    rig: Annotated[Path, typer.Argument(metavar="RIG.toml", help="A rig of kind magnetic, coil or vibro.")],
    model: LearnedModel = None,
    stage: Annotated[
        str, typer.Option("--stage", metavar="nominal/calibrated/augmented", help="Which model.")
    ] = "augmented",
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Draw the plots into this folder.")] = None,
    speed: Annotated[float, typer.Option("--speed", metavar="MM_S", help="Speed in mm/s to linearise at.")] = 1.0,
    delay: Annotated[
        float, typer.Option("--delay", metavar="MS", help="Age of a measurement in ms when the command acts.")
    ] = 15.0,
    json_output: Json = False,
) -> None:
    """Linear design: gains, margins with delay, bandwidth, stick-slip cycles; for vibro resonance, gears and slow
    loop.
    """
    from hil.app.design.command import design

    with own_folder(out, "--out"):
        design(rig, model, out, stage=stage, speed_mm_s=speed, delay_ms=delay, json_output=json_output)


@_command("track", "capsule track hil/scenarios/track_magnetic_ramp.toml --controller mpc --out out")
def _track(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO.toml", help="Rig, reference, instruments and what is believed.")
    ],
    controller: ControllerName = None,
    model: LearnedModel = None,
    stage: ModelStage = None,
    seed: RunSeed = None,
    reference: ReferenceFile = None,
    compare: Annotated[bool, typer.Option("--compare", help="Run every controller.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for track.html and track.json.")
    ] = None,
    json_output: Json = False,
    effects: OwnEffects = None,
    controllers: OwnControllers = None,
) -> int:
    """Closed loop in simulation, no bus: reference tracking with a named controller; status 1 where a check of the
    scenario fails.
    """
    from controller.registry import use_controllers
    from hil.app.scenario.options import Options
    from hil.app.track.command import track
    from models.effects import use_effects

    use_effects(effects or [])
    use_controllers(controllers or [])
    with own_folder(out, "--out"):
        return track(scenario, Options(controller, model, stage, seed, out, json_output, reference), compare)


@_command("sil", "capsule sil hil/scenarios/sil_magnetic_drop.toml --out out")
def _sil(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="As for track, with [bus] and [[faults]].")],
    controller: ControllerName = None,
    model: LearnedModel = None,
    stage: ModelStage = None,
    seed: RunSeed = None,
    reference: ReferenceFile = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for sil.json and the log frames.blf.")
    ] = None,
    learn: Learn = False,
    mcap: McapFile = None,
    watch: Annotated[
        str | None,
        typer.Option("--watch", metavar="CHANNEL", help="In real time, its frames on this local bus: for cockpit."),
    ] = None,
    json_output: Json = False,
    effects: OwnEffects = None,
    controllers: OwnControllers = None,
) -> int:
    """Closed loop over the CAN bus in simulated time, plant as a bus node, with faults."""
    from controller.registry import use_controllers
    from hil.app.scenario.options import Options
    from hil.app.sil.command import sil
    from models.effects import use_effects

    use_effects(effects or [])
    use_controllers(controllers or [])
    with own_folder(out, "--out"):
        asked = Options(controller, model, stage, seed, out, json_output, reference, learn, mcap, watch)
        return sil(scenario, asked)


@_command("run", "capsule run deployment.toml check")
def _run(
    rig: Annotated[
        Path, typer.Argument(metavar="RIG.toml", help="A rig file with [bus], [control], [reference] and [limits].")
    ],
    action: Annotated[
        str,
        typer.Argument(
            metavar="check|reset", help="check: look at all, send nothing; reset: acknowledge a latched fault, no more."
        ),
    ] = "lead",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Listen and compute, send nothing.")] = False,
    log: Annotated[
        Path | None, typer.Option("--log", metavar="LOG.blf", help="Where the log goes; else beside you.")
    ] = None,
    mcap: McapFile = None,
    reference: ReferenceFile = None,
    json_output: Json = False,
    effects: OwnEffects = None,
    controllers: OwnControllers = None,
    learn: Learn = False,
    move: Annotated[
        bool, typer.Option("--move", help="With check: lead the drive by 5 mm to and fro, and see the capsule answer.")
    ] = False,
) -> int:
    """The controller alone, on a real actuator bus."""
    from controller.registry import use_controllers
    from hil.app.run.command import run
    from models.effects import use_effects

    use_effects(effects or [])
    use_controllers(controllers or [])
    return run(
        rig,
        action,
        dry_run=dry_run,
        log=log,
        json_output=json_output,
        reference=reference,
        learn=learn,
        mcap=mcap,
        move=move,
    )


@_command("plant", "capsule plant examples/deployment/deployment.toml --seconds 60")
def _plant(
    deployment: Annotated[
        Path, typer.Argument(metavar="DEPLOYMENT.toml", help="A deployment file whose [plant] names a scenario.")
    ],
    seconds: Annotated[
        float | None, typer.Option("--seconds", metavar="S", help="For how long; else until Ctrl-C.")
    ] = None,
    lie: Annotated[
        list[str] | None,
        typer.Option(
            "--lie", metavar="KIND[:TARGET][=VALUE][@S]", help="What its localiser or drive lies about, and from when."
        ),
    ] = None,
    json_output: Json = False,
) -> None:
    """The simulated drive side alone, on the bus that the deployment file names; prints `ready` once it is there."""
    from hil.app.run.simulated_plant import plant

    plant(deployment, seconds, lie or [], json_output=json_output)


@_command("cockpit", "capsule cockpit deployment.toml")
def _cockpit(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="DEPLOYMENT.toml | LOG | SCENARIO.toml",
            help="A deployment file, whose bus is watched; a CAN log; or, with --watch, the scenario of a sil.",
        ),
    ],
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Where to listen; else this machine alone can see it.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", metavar="N", help="0: a free one.")] = 8420,
    watch: Annotated[
        str | None,
        typer.Option("--watch", metavar="CHANNEL", help="The local bus on which `capsule sil --watch` runs SOURCE."),
    ] = None,
    json_output: Json = False,
) -> None:
    """A page in the browser: a bus while it runs, or a log to scrub through; steers with the token that it prints."""
    from hil.app.cockpit.command import cockpit

    cockpit(source, host, port, watch, json_output=json_output)


@_command("jog", "capsule jog examples/deployment/deployment.toml")
def _jog(
    deployment: Annotated[
        Path, typer.Argument(metavar="DEPLOYMENT.toml", help="A deployment file with [operator] accept = true.")
    ],
    source: Annotated[
        str, typer.Option("--source", metavar="NAME", help="Sender: keyboard, cockpit, joystick, ros, script, other.")
    ] = "keyboard",
    script: Annotated[
        str | None,
        typer.Option(
            "--script",
            metavar="FILE",
            help="Lines 'speed MM_S SECONDS', 'position MM SECONDS', 'release SECONDS' instead of keys; - for stdin.",
        ),
    ] = None,
    life_ms: Annotated[
        float, typer.Option("--life", metavar="MS", help="How long a setpoint counts; 1 to 200.")
    ] = 100.0,
    json_output: Json = False,
) -> int:
    """Steer a controller that leads: the arrow keys while held, or a script."""
    from hil.app.jog.command import jog

    return jog(deployment, source, script, life_ms, json_output=json_output)


@_command("replay", "capsule replay run.blf")
def _replay(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A log of the controller, its record beside it.")],
    json_output: Json = False,
    effects: OwnEffects = None,
    controllers: OwnControllers = None,
) -> int:
    """The controller again on a log: its frames compared bit by bit."""
    from controller.registry import use_controllers
    from hil.app.run.replay import replay
    from models.effects import use_effects

    use_effects(effects or [])
    use_controllers(controllers or [])
    return replay(log, json_output=json_output)


@_command("campaign", "capsule campaign hil/scenarios/campaign_magnetic.toml --out out/campaign")
def _campaign(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="CAMPAIGN.toml | FOLDER...",
            help="A scenario and what is varied in it; or folders of series, rig.toml and records in each.",
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for results and report; resumed where it has some.")
    ] = Path("out/campaign"),
    workers: Annotated[int | None, typer.Option("--workers", metavar="N", help="Processes; else one a core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="A Dask scheduler to run on.")
    ] = None,
    number: Annotated[int | None, typer.Option("--run", metavar="N", help="Do run N alone and print it.")] = None,
    json_output: Json = False,
    seed: Annotated[
        int, typer.Option("--seed", min=0, max=MOST_SEED, help="Of folders: sets every random number.")
    ] = 0,
    effects: OwnEffects = None,
) -> int:
    """Thousands of closed loops: distributions and worst cases. Or close-loop on folders of series: what each rig
    lacks, how sure, how much better, which disagree.
    """
    from hil.app.campaign.command import campaign
    from hil.app.campaign.folders.command import folders

    if len(paths) == 1 and not paths[0].is_dir():
        if effects or seed:
            raise ValueError("--effects and --seed must be left out with a campaign file, which has its own seed")
        with own_folder(out if number is None else None, "--out"):
            return campaign(paths[0], out, workers=workers, scheduler=scheduler, run=number, json_output=json_output)
    if number is not None:
        raise ValueError("--run must be left out with folders: close-loop does one series alone")
    with own_folder(out, "--out"):
        return folders(
            paths, out, effects=effects or [], seed=seed, workers=workers, scheduler=scheduler, json_output=json_output
        )


@_command("demo", "capsule demo --out out/demo")
def _demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the reports.")] = Path("out/demo"),
    json_output: Json = False,
    seed: Seed = 0,
) -> None:
    """The whole story in one go: drive, record, find what the model lacks, redeploy, compare."""
    from hil.app.demo.command import demo

    demo(out, json_output=json_output, seed=seed)


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
    for option, word in pairwise(("capsule", *args)):
        if word.removesuffix("=") in FILES and word.endswith("="):
            return _said(f"{word[:-1]} must name a file or a folder; got nothing", BAD_INPUT)
        if not word and (option in FILES or not option.startswith("-")):
            what = option if option in FILES else f"what follows {option[:60]!r}"
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
        given = next((word for option, word in pairwise(args) if option == wrong[1]), "")
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
