"""`capsule` in a process of its own that need not be loaded again: forked from a server that has loaded it once.

Starting anew takes some seconds of a processor, which a test of what two processes say to each other need not spend.
That processes started anew do the same is tested in `tests/examples/test_deployment.py`.
"""

import os
import signal
import sys
import time
from multiprocessing import get_context
from pathlib import Path

from hil.app.main import run

SERVER = get_context("forkserver")
SERVER.set_forkserver_preload(["tests.hil.app.run.loaded"])
LONGEST_S = 60.0


class Forked:
    """One command in `folder`; what it says goes to files there."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.files = [folder / f"{words[0]}.{name}" for name in ("out", "err")]
        for file in self.files:
            file.write_text("")
        self.process = SERVER.Process(target=_work, args=(folder, words, self.files), daemon=True)
        self.process.start()

    def until_ready(self) -> None:
        """Wait for the line that a plant says when it is ready."""
        end = time.monotonic() + LONGEST_S
        while "\n" not in self.files[1].read_text():
            assert self.process.is_alive(), self.files[1].read_text()
            assert time.monotonic() < end
            time.sleep(0.01)
        assert self.files[1].read_text() == "ready\n"

    def send_signal(self, number: int) -> None:
        assert self.process.pid is not None
        os.kill(self.process.pid, number)

    def kill(self) -> None:
        self.process.kill()
        self.process.join()

    def terminate(self) -> None:
        self.process.terminate()

    def ended(self) -> tuple[int, str, str]:
        """Its status once it has ended, and what it said on both outputs."""
        self.process.join(LONGEST_S)
        assert self.process.exitcode is not None
        out, err = (file.read_text() for file in self.files)
        return self.process.exitcode, out, err


def _work(folder: Path, words: tuple[str, ...], files: list[Path]) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets what it runs in the background ignore it
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    os.chdir(folder)
    for number, file in enumerate(files, start=1):
        os.dup2(os.open(file, os.O_WRONLY | os.O_APPEND), number)
    sys.exit(run(words))
