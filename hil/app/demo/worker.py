"""The demo's stories, a process each and two at a time, with a line of progress for every one."""

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Final

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from hil.app.console import notes, output_to_notes, stage_lines
from hil.app.demo.story import Learned, Story, Told

WORKERS: Final = 2  # stories at a time
Reporter = Callable[[str, str, float], None]


@dataclass(frozen=True)
class _Worker:
    story: Story
    process: BaseProcess
    words: Connection


def told(stories: Sequence[Story], folder: Path, seed: int, report: Reporter) -> dict[str, Told | Learned]:
    """What came of each story by name, told in processes of their own; the first ones begin first. Each has
    `folder`/name to itself.

    Raises a story's ValueError or OSError, RuntimeError where its process died; no process goes on after that or an
    interruption.
    """
    waiting, working, found = list(stories), list[_Worker](), dict[str, Told | Learned]()
    try:
        while waiting or working:
            while waiting and len(working) < WORKERS:
                working.append(_begin(waiting.pop(0), folder, seed))
            ready = wait([worker.words for worker in working])
            for worker in [w for w in working if w.words in ready]:
                word = _heard(worker)
                if isinstance(word, Told | Learned):
                    found[worker.story.name] = word
                    worker.process.join()
                    working.remove(worker)
                else:
                    report(worker.story.name, *word)
    finally:
        for worker in working:
            worker.process.terminate()
            worker.process.join()
    return found


def _begin(story: Story, folder: Path, seed: int) -> _Worker:
    """A process that leaves Ctrl-C to this one, which ends it."""
    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_tell, args=(story, folder / story.name, seed, theirs), daemon=True)
    listening = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process.start()
    finally:
        signal.signal(signal.SIGINT, listening)
    theirs.close()
    return _Worker(story, process, ours)


def _heard(worker: _Worker) -> Told | Learned | tuple[str, float]:
    try:
        word = worker.words.recv()
    except EOFError:
        worker.process.join()
        raise RuntimeError(
            f"process of the story {worker.story.name} ended with status {worker.process.exitcode}"
        ) from None
    if isinstance(word, ValueError | OSError):
        raise word
    answer: Told | Learned | tuple[str, float] = word
    return answer


def _tell(story: Story, folder: Path, seed: int, words: Connection) -> None:
    """What a process does: progress, then what came of it or the sentence that says why nothing did."""
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
        yield _lines()
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


def _lines() -> Reporter:
    lines: dict[str, Callable[[str, float], None]] = {}

    def report(name: str, stage: str, share: float) -> None:
        if name not in lines:
            lines[name] = stage_lines(notes(), name)
        lines[name](stage, share)

    return report
