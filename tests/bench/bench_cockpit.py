"""What the cockpit costs the control loop, itself and the network: `python -m tests.bench.bench_cockpit`.

Plant and `capsule run` in two processes, as `examples/deployment` has them, once alone, once with a cockpit and one
page at 25 pictures a second on the same bus, in turn, `--pairs` of them. Told are the lateness of the ticks, the time
that they took, the cockpit's share of a core and memory, and the bytes of a picture. What else the machine does is in
all of them alike; it may end a run, which is said.
"""

import argparse
import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import can
import numpy as np
import tornado.websocket

from hil.bus.local import LocalBus
from tests.places import ROOT

CAPSULE = (sys.executable, "-m", "hil.app.start")
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
_TICKS_S = os.sysconf("SC_CLK_TCK")


def files(folder: Path, seconds: float) -> Path:
    """The example's deployment on a bus of its own, for so long."""
    example = ROOT / "examples" / "deployment"
    (folder / "plant.toml").write_text((example / "plant.toml").read_text())
    text = (example / "deployment.toml").read_text()
    text = text.replace('channel = "deployment"', f'channel = "bench-{os.getpid()}"')
    path = folder / "deployment.toml"
    path.write_text(text.replace("duration_s = 10.0", f"duration_s = {seconds}"))
    return path


@contextmanager
def process(*words: str) -> Iterator[subprocess.Popen[str]]:
    """A command in the background, once it has said its first word."""
    child = subprocess.Popen([*CAPSULE, *words], stdout=subprocess.PIPE, text=True, env=ENVIRONMENT)
    try:
        yield child
    finally:
        child.terminate()
        child.communicate()


class Page(subprocess.Popen[str]):
    """A page that takes what it gets, in a process of its own."""

    def __init__(self, address: str) -> None:
        words = [sys.executable, "-m", "tests.bench.bench_cockpit", "--page", address]
        super().__init__(words, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT, cwd=ROOT)


async def look(address: str) -> None:
    """Be a page until killed; sizes of pictures and states go to standard output."""
    page = await tornado.websocket.websocket_connect(address.replace("http", "ws") + "socket")
    while (told := await page.read_message()) is not None:
        print("picture" if isinstance(told, bytes) else "state", len(told), flush=True)


def used_s(pid: int) -> float:
    """Processor time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_S


def memory_MB(pid: int) -> float:
    """Resident memory."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def led(path: Path) -> dict[str, Any]:
    """What `capsule run` says of one run."""
    words = [*CAPSULE, "run", str(path), "--json", "--log", str(path.with_name("bench.blf"))]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=ENVIRONMENT)
    return dict(json.loads(done.stdout)) if done.stdout else {"ended": done.stderr.strip(), "ticks": 0}


def once(path: Path, watched: bool) -> dict[str, Any]:
    """One run on a fresh plant, alone or watched."""
    with process("plant", str(path)) as plant:
        assert plant.stdout is not None
        plant.stdout.readline()
        if not watched:
            return led(path)
        with process("cockpit", str(path), "--port", "0") as cockpit:
            assert cockpit.stdout is not None
            cockpit.stdout.readline()
            address = cockpit.stdout.readline().split(": ")[1].strip()
            page = Page(address)
            time.sleep(2.0)
            before, began = used_s(cockpit.pid), time.monotonic()
            found = led(path)
            found["share"] = (used_s(cockpit.pid) - before) / (time.monotonic() - began)
            found["memory_MB"] = memory_MB(cockpit.pid)
            page.terminate()
            told = page.communicate()[0].split("\n")
            found["bytes"] = [int(line.split()[1]) for line in told if line.startswith("picture")]
            found["state_bytes"] = [int(line.split()[1]) for line in told if line.startswith("state")]
            return found


def send_us(readers: int, frames: int = 3000) -> float:
    """Median time in us that a frame takes its sender on the local bus with so many readers, who read in time."""
    channel, took = f"bench-send-{os.getpid()}", []
    with ExitStack() as stack:
        sender, *others = (stack.enter_context(LocalBus(channel)) for _ in range(1 + readers))
        message = can.Message(arbitration_id=1, is_extended_id=False, data=bytes(8))
        for k in range(frames):
            began = time.perf_counter()
            sender.send(message)
            took.append(time.perf_counter() - began)
            if k % 50 == 0:
                for other in others:
                    while other.recv(0) is not None:
                        pass
    return 1e6 * float(np.median(took))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--page", default="")
    asked = parser.parse_args()
    if asked.page:
        asyncio.run(look(asked.page))
        return
    told = ", ".join(f"{n}: {send_us(n):.1f} us" for n in (1, 2, 3))
    print(f"a frame takes its sender, by the number of readers on the local bus: {told}")
    with tempfile.TemporaryDirectory() as folder:
        path = files(Path(folder), asked.seconds)
        for number in range(asked.pairs):
            for watched in (False, True) if number % 2 == 0 else (True, False):
                say(once(path, watched), watched)


def say(found: dict[str, Any], watched: bool) -> None:
    """One run's line."""
    words = f"{'watched' if watched else 'alone  '} {found['ticks']:6d} ticks, {found.get('missed_ticks', 0)} missed"
    for name, what in (("late_ms", "late"), ("tick_ms", "took")):
        times = found.get(name)
        if times:
            words += f"; {what} ms: median {times['median']:.3f}, p99 {times['p99']:.3f}, max {times['max']:.2f}"
    if watched and found.get("bytes"):
        sizes = np.array(found["bytes"])
        words += (
            f"; cockpit {100 * found['share']:.1f} % of a core, {found['memory_MB']:.0f} MB; picture"
            f" {np.median(sizes):.0f} bytes, state {np.median(found['state_bytes']):.0f}"
        )
    print(f"{words}; ended: {found['ended']}", flush=True)


if __name__ == "__main__":
    main()
