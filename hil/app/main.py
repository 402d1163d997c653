"""The program `capsule`: one command a task; bad input ends with status 2 and one sentence on standard error."""

import os
import re
import sys
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Final

import typer
from threadpoolctl import threadpool_limits
from typer.core import TyperArgument, TyperCommand, TyperGroup

from hil.app.console import TEXT, InterruptionError, note, print_json, printable
from hil.app.shared_options import declared
from hil.app.system import INTERRUPTED, INTERRUPTION
from hil.app.write import file_trouble
from hil.own_process import version_of
from models.files.toml import beside
from models.parameter import nearest

BAD_INPUT = 2  # exit status
FILES = (
    "--out", "--rig", "--model", "--reference", "--holdout", "--log", "--mcap", "--plot", "--effects", "--controllers",
)  # fmt: skip
GROUPS: Final = beside(__file__, "commands.toml")
COMMANDS: Final = {name: one for group in GROUPS.values() for name, one in group.items()}


class _Command(TyperCommand):
    """A command whose module is loaded once its words are understood and its files are there."""

    def __init__(self, name: str) -> None:
        self.target, example = COMMANDS[name]["does"], f"Example: capsule {name} {COMMANDS[name]['example']}"
        super().__init__(name, help=TEXT(f"help.{name}"), epilog=example, rich_markup_mode=None)

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.command(self.name, help=self.help, epilog=self.epilog)(
            declared(self.target, COMMANDS[self.name].get("words", {}))
        )
        command = typer.main.get_command(app)
        for one in command.params:
            if isinstance(one, TyperArgument):  # its metavar says more than `<list[Path]>`
                vars(one)["display_type_rich"] = lambda ctx: ""
        return command.make_context(info_name, args, parent, **extra)


class _Program(TyperGroup):
    """The commands in groups, each with the first clause of its help, which fits on a line."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        for heading, names in GROUPS.items():
            with formatter.section(TEXT(f"group.{heading}")):
                formatter.write_dl([(name, re.split("[:;.]", TEXT(f"help.{name}"))[0]) for name in names])


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
        typer.echo(f"capsule {version_of()}")
        raise typer.Exit


def _program() -> TyperGroup:
    app = typer.Typer(name="capsule", cls=_Program, help=TEXT("program"), rich_markup_mode=None)

    @app.callback()
    def _options(
        show: Annotated[
            bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
        ] = False,
    ) -> None:
        pass

    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    for name in COMMANDS:
        group.add_command(_Command(name))
    return group


def one_thread() -> None:
    """Small matrices on one thread, here and in children: others would wait for processors that are busy."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    threadpool_limits(1)


def run(args: Sequence[str]) -> int:
    """The exit status of the command line `args`. What is wrong goes to standard error in a sentence, and with `--json`
    to standard output as `{"error": "...", "status": 2}`.
    """
    status, sentence, pasted = _run(args)
    if sentence:
        print("capsule:", printable(" ".join(sentence.split())), file=sys.stderr)
        if "--json" in args:
            print_json({"error": " ".join(sentence.split()), "status": status})
    for text in pasted:
        print(printable(text), file=sys.stderr)
    return status


def _run(args: Sequence[str]) -> tuple[int, str, Sequence[str]]:
    """The status, the sentence that says what is wrong, and what may be pasted into a file."""
    one_thread()
    for before, word in pairwise(("capsule", *args)):
        if word.removesuffix("=") in FILES and word.endswith("="):
            return BAD_INPUT, f"{word[:-1]} must name a file or a folder; got nothing", ()
        if not word and (before in FILES or not before.startswith("-")):
            what = before if before in FILES else f"what follows {before[:60]!r}"
            return BAD_INPUT, f"{what} must name a file or a folder; got nothing", ()
    try:
        words = spread_option("--holdout", args) or ["--help"]
        if words.count("--holdout") > args.count("--holdout"):
            note(TEXT("held", names=[word for before, word in pairwise(words) if before == "--holdout"]))
        status = _program().main(words, prog_name="capsule", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED, INTERRUPTION, ()
    except InterruptionError as error:
        return INTERRUPTED, str(error), ()
    except typer.TyperException as error:
        return BAD_INPUT, _usage(error, args), ()
    except OSError as error:
        return BAD_INPUT, file_trouble(error), ()
    except ValueError as error:
        if os.environ.get("CAPSULE_TRACEBACK"):
            raise
        return BAD_INPUT, str(error), getattr(error, "__notes__", ())
    if status == INTERRUPTED:
        return INTERRUPTED, INTERRUPTION, ()
    return (status if isinstance(status, int) else 0), "", ()


def _usage(error: typer.TyperException, args: Sequence[str]) -> str:
    format_message = getattr(error, "format_message", None)
    message = (format_message() if format_message else str(error)).rstrip(".")
    wrong = re.fullmatch(r"Invalid value for '(.+?)': Input should be (.+?)(?:, unable to .*)?", message)
    if wrong:
        given = next((word for before, word in pairwise(args) if before == wrong[1]), "")
        message = f"{wrong[1]} must be {wrong[2]}" + (f"; got {given[:60]!r}" if given else "")
    if args[0] in COMMANDS:
        return f"{message}; see 'capsule {args[0]} --help'"
    return f"{message.split('. Did you')[0]}; {nearest(args[0], COMMANDS)}"
