"""What a command prints: summary on standard output, notes and progress on standard error, or one JSON object."""

import contextlib
import json
import math
import re
import sys
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any, Final

from rich.box import HEAVY_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from models.words.quantities import plain
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
WIDTH = 110  # characters, where there is no terminal
QUIET_S = 10.0  # Off a terminal, a stage that lasts prints a line after this time
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
_STEPS = 100_000  # of a bar
_FIRST_SHARE = 0.02  # of the work, before the remaining time is estimated


class InterruptionError(Exception):
    """Long work that the user stopped; its text says what was kept."""


def printable(text: str) -> str:
    """A text with the code points of characters that are no text, command a terminal or reverse the direction of
    writing.
    """
    return _CONTROL.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


class PlainConsole(Console):
    """A console that prints names from files as plain text, as wide as `WIDTH` where there is no terminal."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, highlight=False, markup=False, emoji=False)
        if not self.is_terminal:
            self.width = WIDTH

    def render_str(self, text: str, **how: Any) -> Text:
        return super().render_str(printable(text), **how)


def notes() -> Console:
    return PlainConsole(stderr=True)


def summary() -> Console:
    return PlainConsole()


def say(*lines: str) -> None:
    for line in lines:
        summary().print(line, soft_wrap=True)


def note(line: str) -> None:
    notes().print(line, soft_wrap=True)


def text_table(title: str, heads: Sequence[str], words: Collection[str] = ("",), *, bare: bool = False) -> Table:
    """An empty table for the terminal: columns named among `words` hold words, the others numbers; `bare`: no frame."""
    table = Table(title=title or None, title_justify="left", box=None if bare else HEAVY_HEAD, pad_edge=not bare)
    for head in heads:
        table.add_column(head, justify="left" if head in words else "right")
    return table


def print_json(document: Any) -> None:
    """Print one JSON object; numbers that are not finite become null."""
    sys.stdout.write(json_text(document))


def answer(json_output: bool, document: Any, *lines: Any) -> None:
    """Print the `document` as JSON where that is asked for, else `lines` without wrapping and tables to fit."""
    if json_output:
        print_json(document)
        return
    for one in lines:
        summary().print(one, soft_wrap=isinstance(one, str))


def json_text(document: Any) -> str:
    return printable(json.dumps(plain(document), indent=2, allow_nan=False, ensure_ascii=False)) + "\n"


@contextlib.contextmanager
def output_to_notes() -> Iterator[None]:
    with contextlib.redirect_stdout(sys.stderr):
        yield


@contextlib.contextmanager
def progress_bar(title: str, *, even: bool = False, done: float = 0.0) -> Iterator[Callable[[str, float], None]]:
    """Progress on standard error: a bar on a terminal, else a line for each new stage and every `QUIET_S`. `even` work
    also gets its remaining time, from the pace since `done` of it. Yields `report(stage, fraction)`, of which the
    largest fraction so far counts; what follows a colon in `stage` is a step of it.
    """
    console, most = notes(), 0.0
    if not console.is_terminal:
        yield stage_lines(console, title, even=even, done=done)
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[percent]:3d} %"),
        TimeElapsedColumn(),
        *([TextColumn("remaining"), TimeRemainingColumn()] if even else []),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title, total=_STEPS, completed=round(_STEPS * done), percent=math.floor(100 * done))

        def report(stage: str, fraction: float) -> None:
            nonlocal most
            most = part = min(max(fraction, most), 1.0)
            said = escape(printable(f"{title}: {stage}"))
            progress.update(task, description=said, completed=_STEPS * part, percent=math.floor(100 * part))

        yield report


def part_of(report: Callable[[str, float], None], begin: float, end: float) -> Callable[[str, float], None]:
    """The progress of a part of the work, from the share `begin` of it to `end`."""
    return lambda stage, share: report(stage, begin + (end - begin) * share)


def stage_lines(
    console: Console,
    title: str,
    *,
    even: bool = False,
    done: float = 0.0,
    clock: Callable[[], float] = time.monotonic,
) -> Callable[[str, float], None]:
    """The `report(stage, fraction)` of `progress_bar` off a terminal: it prints lines."""
    began = said = clock()
    last, most = "", 0.0

    def report(stage: str, fraction: float) -> None:
        nonlocal last, said, most
        now, most = clock(), min(max(fraction, most), 1.0)
        head = stage.partition(":")[0]
        if head == last and now - said < QUIET_S:
            return
        last, said = head, now
        spent = now - began
        times = TEXT("console.spent", seconds=round(spent)) if spent >= QUIET_S else ""
        if even and times and (most - done > _FIRST_SHARE * (1 - done)) and most < 1.0:
            times += TEXT("console.remaining", seconds=math.ceil(spent * (1 - most) / (most - done)))
        console.print(f"{title}: {math.floor(100 * most):3d} %  {stage}{times}", markup=False)

    return report
