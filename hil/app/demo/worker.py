"""The demo's stories, a process each and two at a time, with a line of progress for every one."""

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Final

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from hil.app.console import notes, output_to_notes, stage_lines
from hil.app.demo.story import TEXT, End, Story

WORKERS: Final = 2  # stories at a time
Reporter = Callable[[str, str, float], None]


def results_of(stories: Sequence[Story], folder: Path, seed: int, report: Reporter) -> dict[str, End]:
    """What came of each story by name. Each has a process and `folder`/name to itself; the first ones begin first.

    Raises a story's ValueError or OSError, RuntimeError where its process died; no process goes on after that or an
    interruption.
    """
    waiting, working, found = list(stories), dict[Connection, tuple[str, BaseProcess]](), dict[str, End]()
    try:
        while waiting or working:
            while waiting and len(working) < WORKERS:
                story = waiting.pop(0)
                process, words = _begin(story, folder / story.name, seed)
                working[words] = story.name, process
            ready = wait(list(working))
            for words in [words for words in working if words in ready]:
                name, process = working[words]
                try:
                    word = words.recv()
                except EOFError:
                    process.join()
                    raise RuntimeError(TEXT("dead", story=name, status=process.exitcode)) from None
                if isinstance(word, Exception):
                    raise word
                if isinstance(word, tuple):
                    report(name, *word)
                else:
                    found[name] = word
                    process.join()
                    del working[words]
    finally:
        for _, process in working.values():
            process.terminate()
            process.join()
    return found


def _begin(story: Story, folder: Path, seed: int) -> tuple[BaseProcess, Connection]:
    """A process that leaves Ctrl-C to this one, which ends it, and the end of its pipe."""
    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_tell, args=(story, folder, seed, theirs), daemon=True)
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process.start()
    finally:
        signal.signal(signal.SIGINT, handler)
    theirs.close()
    return process, ours


def _tell(story: Story, folder: Path, seed: int, words: Connection) -> None:
    """In the story's process: send progress, then the result or the error."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with output_to_notes():
            words.send(story.tell(folder, seed, lambda stage, share: words.send((stage, share))))
    except ValueError as error:
        words.send(ValueError(str(error)))
    except BrokenPipeError:
        sys.exit(1)
    except OSError as error:
        words.send(error)


@contextlib.contextmanager
def story_bars(names: Sequence[str]) -> Iterator[Reporter]:
    """Show progress on standard error: a bar for each name on a terminal, else a line for each new stage. Yields
    `report(name, stage, share)`.
    """
    console = notes()
    if not console.is_terminal:
        lines = cache(lambda name: stage_lines(console, name))
        yield lambda name, stage, share: lines(name)(stage, share)
        return
    columns = (
        TextColumn("{task.fields[name]:10s}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, TextColumn("{task.description}"), console=console) as progress:
        bars = {name: progress.add_task("waiting", total=1.0, start=False, name=name) for name in names}

        def report(name: str, stage: str, share: float) -> None:
            if progress.tasks[bars[name]].start_time is None:
                progress.start_task(bars[name])
            progress.update(bars[name], description=stage, completed=min(max(share, 0.0), 1.0))
            if share >= 1:
                progress.stop_task(bars[name])

        yield report
