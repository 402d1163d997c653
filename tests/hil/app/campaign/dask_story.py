"""Campaigns on Dask clusters whose workers are killed, told as JSON: `python -m tests.hil.app.campaign.dask_story STORY
FOLDER`.

Scheduler, workers, campaigns and killers are processes forked from this one, which has imported all they need, so each
is there at once.
"""

import json
import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from functools import partial
from multiprocessing import active_children, get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import dask
from distributed import Client
from distributed.cli import dask_scheduler, dask_worker

from hil.app import cluster
from hil.app.campaign import running as campaign
from hil.app.campaign import worker
from hil.app.campaign.dask_cluster import scheduled
from hil.app.campaign.worker import Loop
from hil.app.main import run
from models.theta import Theta

LONGEST_S = 100.0
SETTLED_S = 0.3
PATIENCE_S = 2.0


class Cluster:
    """A scheduler that gives a chunk to `failures` + 1 workers at most, and workers of one thread."""

    def __init__(self, folder: Path, failures: int = 3) -> None:
        self.folder, file = folder, folder / "scheduler.json"
        self.scheduler = forked(folder / "scheduler.log", _scheduler, file, failures)
        until(lambda: file.exists() and file.read_text().rstrip().endswith("}"))
        self.address: str = json.loads(file.read_text())["address"]

    def worker(self, name: str, main: Callable[..., Any] = dask_worker.main) -> BaseProcess:
        """One more worker."""
        options = [
            "--name",
            name,
            "--no-nanny",
            "--nthreads",
            "1",
            "--no-dashboard",
            "--local-directory",
            str(self.folder),
        ]
        return forked(self.folder / f"{name}.log", main, [self.address, *options])


def old_worker(words: list[str]) -> None:
    """A worker with another version of the program."""
    cluster.program_version = lambda: "0.1 of yesterday"  # type: ignore[assignment]
    worker.program_version = cluster.program_version
    cluster.program_version.__module__, cluster.program_version.__qualname__ = cluster.__name__, "program_version"
    dask_worker.main(words)


def _scheduler(file: Path, failures: int) -> None:
    with dask.config.set({"distributed.scheduler.allowed-failures": failures, "temporary-directory": str(file.parent)}):
        dask_scheduler.main(["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)])


def forked(log: Path, target: Callable[..., Any], *arguments: Any) -> BaseProcess:
    """A process of its own that ends with `target`'s value as its status; what it says goes to `log`."""

    def work() -> None:
        for number in (1, 2):
            os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND), number)
        sys.exit(target(*arguments))

    child = get_context("fork").Process(target=work, daemon=True)
    child.start()
    return child


def until(true: Callable[[], Any]) -> None:
    """Wait, but not for ever."""
    end = time.monotonic() + LONGEST_S
    while not true():
        if time.monotonic() > end:
            sys.exit("too late")
        time.sleep(0.05)


def ended(child: BaseProcess) -> int | None:
    """The status of a process, None of one that does not end."""
    child.join(LONGEST_S)
    return child.exitcode


def on_file(out: Path) -> int:
    """How many runs the results hold."""
    results = out / "results.jsonl"
    return max(results.read_bytes().count(b"\n") - 1, 0) if results.exists() else 0


def kill_at_work(address: str, name: str, pid: int, out: Path, least: int, note: Path) -> None:
    """Kill a worker that has chunks, once `least` runs are on file: it is stopped, the scheduler takes in what it had
    still said, and where chunks of it are left it is killed, else it goes on and is stopped again. `note` says which
    chunks died with it, and when.
    """
    with Client(address, timeout=20) as client:

        def held() -> list[str]:
            workers = client.scheduler_info()["workers"]
            return [str(key) for at, keys in client.processing().items() if workers[at]["id"] == name for key in keys]

        while True:
            until(lambda: on_file(out) >= least and held())
            os.kill(pid, signal.SIGSTOP)
            time.sleep(SETTLED_S)
            if left := held():
                note.write_text(json.dumps({"held": left, "on_file": on_file(out)}))
                os.kill(pid, signal.SIGKILL)
                return
            os.kill(pid, signal.SIGCONT)


def killed(folder: Path) -> dict[str, Any]:
    """The only worker dies at work; then the same command with two workers, of which one dies at work."""
    campaign.scheduled = partial(scheduled, timeout_s=PATIENCE_S)  # type: ignore[assignment]
    cluster, out = Cluster(folder), folder / "out"
    command = ["campaign", str(folder / "campaign.toml"), "--out", str(out), "--scheduler", cluster.address, "--json"]

    def cut(name: str, least: int) -> dict[str, Any]:
        victim, log, note = cluster.worker(name), folder / f"campaign-{name}.log", folder / f"{name}.json"
        began = time.monotonic()
        killer = forked(folder / "killer.log", kill_at_work, cluster.address, name, victim.pid, out, least, note)
        status = ended(forked(log, run, command))
        seconds = round(time.monotonic() - began, 1)
        found = {
            "status": status,
            "said": log.read_text(),
            "killer": ended(killer),
            "worker": ended(victim),
            "seconds": seconds,
        }
        return found | json.loads(note.read_text())

    first = cut("first", 1)
    before = on_file(out)
    cluster.worker("third")
    return {"address": cluster.address, "alone": first, "before": before, "beside": cut("second", before + 2)}


class Poison(Loop):
    """A job that ends whoever unpacks it."""

    def __reduce__(self) -> Any:
        return os._exit, (1,)


def failing(folder: Path) -> dict[str, Any]:
    """A campaign whose scheduler says nothing; beside it, on three workers of which one is left, a run that kills its
    workers and others; then a campaign whose scheduler dies.
    """
    out = folder / "out"

    def begun(name: str, target: Callable[..., Any], *arguments: Any) -> tuple[BaseProcess, Path]:
        log = folder / f"{name}.log"
        return forked(log, target, *arguments), log

    def begun_on(address: str, name: str) -> tuple[BaseProcess, Path]:
        return begun(
            name, run, ["campaign", str(folder / "campaign.toml"), "--out", str(out / name), "--scheduler", address]
        )

    def told(child: BaseProcess, log: Path) -> dict[str, Any]:
        return {"status": ended(child), "said": log.read_text()}

    silent = socket.create_server(("127.0.0.1", 0))
    nobody = f"127.0.0.1:{silent.getsockname()[1]}"
    ignored = begun_on(nobody, "ignored")

    cluster = Cluster(folder, failures=0)
    workers = [cluster.worker(name) for name in "abc"]
    raw = {"rig": {"kind": "nothing"}}
    jobs = [
        kind(number, "track", raw, 0, {"case": number}, Theta(), "nominal")
        for number, kind in enumerate((Poison, Loop, Loop))
    ]

    def poisoned() -> None:
        print(
            json.dumps([row for part in scheduled([jobs[:2], jobs[2:]], cluster.address, PATIENCE_S) for row in part])
        )

    poison = told(*begun("poison", poisoned))
    left = [worker.is_alive() for worker in workers].count(True)

    old = cluster.worker("old", old_worker)
    with Client(cluster.address, timeout=20) as client:
        until(lambda: len(client.scheduler_info()["workers"]) == left + 1)
    other = told(*begun_on(cluster.address, "other"))
    old.kill()
    with Client(cluster.address, timeout=20) as client:
        until(lambda: len(client.scheduler_info()["workers"]) == left)

    orphan = begun_on(cluster.address, "orphan")
    until(lambda: on_file(out / "orphan") > 0)
    cluster.scheduler.kill()
    found = {"poison": poison, "left": left, "other": other, "orphan": told(*orphan), "ignored": told(*ignored)}
    return found | {"address": cluster.address, "nobody": nobody, "on_file": on_file(out / "orphan")}


STORIES = {"killed": killed, "failing": failing}

if __name__ == "__main__":
    try:
        print(json.dumps(STORIES[sys.argv[1]](Path(sys.argv[2]))), flush=True)
    finally:
        for left in active_children():
            left.kill()
