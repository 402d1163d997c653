"""The demo's examples, a process each and two at a time, with progress for each one."""

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

from hil.app.console import notes, output_to_notes, progress_bar, stage_lines
from hil.app.demo.example import TEXT, End, Example

WORKERS: Final = 2  # examples at a time
Reporter = Callable[[str, str, float], None]


def results_of(examples: Sequence[Example], folder: Path, seed: int, report: Reporter) -> dict[str, End]:
    """What came of each example by name. Each has a process and `folder`/name to itself; the first ones begin first.

    Raises an example's ValueError or OSError, RuntimeError where its process died; no process goes on after that or an
    interruption.
    """
    waiting, working, found = list(examples), dict[Connection, tuple[str, BaseProcess]](), dict[str, End]()
    try:
        while waiting or working:
            while waiting and len(working) < WORKERS:
                example = waiting.pop(0)
                process, words = _begin(example, folder / example.name, seed)
                working[words] = example.name, process
            ready = wait(list(working))
            for words in [words for words in working if words in ready]:
                name, process = working[words]
                try:
                    word = words.recv()
                except EOFError:
                    process.join()
                    raise RuntimeError(TEXT("dead", example=name, status=process.exitcode)) from None
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


def _begin(example: Example, folder: Path, seed: int) -> tuple[BaseProcess, Connection]:
    """A process that leaves Ctrl-C to this one, which ends it, and the end of its pipe."""
    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_tell, args=(example, folder, seed, theirs), daemon=True)
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process.start()
    finally:
        signal.signal(signal.SIGINT, handler)
    theirs.close()
    return process, ours


def _tell(example: Example, folder: Path, seed: int, words: Connection) -> None:
    """In the example's process: send progress, then the result or the error."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with output_to_notes():
            words.send(example.run(folder, seed, lambda stage, share: words.send((stage, share))))
    except ValueError as error:
        words.send(ValueError(str(error)))
    except BrokenPipeError:
        sys.exit(1)
    except OSError as error:
        words.send(error)


@contextlib.contextmanager
def example_progress(names: Sequence[str]) -> Iterator[Reporter]:
    """Show progress on standard error: one bar for all examples on a terminal, else a line for each new stage of each.
    Yields `report(name, stage, share)`.
    """
    console, shares = notes(), dict.fromkeys(names, 0.0)
    lines = cache(lambda name: stage_lines(console, name))
    with progress_bar("demo") if console.is_terminal else contextlib.nullcontext() as bar:

        def report(name: str, stage: str, share: float) -> None:
            shares[name] = share
            if bar is None:
                lines(name)(stage, share)
            else:
                bar(f"{name}, {stage}", sum(shares.values()) / len(shares))

        yield report
