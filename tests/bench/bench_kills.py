"""Controllers that are killed while they lead: what of their frames stands in the log, and whether it replays.

`python -m tests.bench.bench_kills [--kills N] [--seed N] [--latest S]`: each kill is SIGKILL at a random instant, up to
`--latest` s after the drive was enabled, to the controller alone or to it and its log's writer by turns. Frames that a
bystander on the bus has heard of it are compared with the log's, one by one; 1 where frames older than a second are
missing, others stand there, or a replay differs.
"""

import argparse
import contextlib
import json
import os
import random
import signal
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hil.app.main import run
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from hil.log.blf_file import SENT
from hil.log.reader import read_frames
from hil.nodes.receive import controllers_frames
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.run.forked import LONGEST_S, Forked
from tests.hil.app.run.plant_process import plant_on

ALLOWED_S: Final = 1.0
_SETTLED_S: Final = 0.5


@dataclass(frozen=True)
class Kill:
    """One kill: how long the drive had been enabled, frames `heard` on the bus and those that the log lacks at its end,
    `lost_s` from the first one missing to the last one heard, whether the log holds `others`, and whether it replays
    `alike`.
    """

    after_s: float
    heard: int
    missing: int
    lost_s: float
    others: bool
    alike: bool

    @property
    def good(self) -> bool:
        """Whether the log is what it has to be."""
        return self.alike and not self.others and self.lost_s <= ALLOWED_S


def kill(after_s: float, writer_too: bool) -> Kill:
    """Lead a plant in real time, and kill the controller `after_s` after the drive was enabled."""
    catalogue = load_catalogue()
    own, command = controllers_frames(), catalogue["CarriageCommand"].id
    heard, enabled_at = list[tuple[float, int, bytes]](), float("inf")
    with tempfile.TemporaryDirectory() as name:
        folder, log = Path(name), Path(name) / "run.blf"
        channel = f"kills-{folder.name}"
        rig = rig_file(folder, deployment(channel, control="duration_s = 60.0\npriority = 20"))
        with plant_on(folder, channel), LocalBus(channel) as bystander:
            child, began = Forked(folder, "run", rig, "--log", str(log), "--json"), time.monotonic()
            while (now := time.monotonic()) < enabled_at + after_s and now - began < LONGEST_S:
                message = bystander.recv(0.001)
                if message is None or message.arbitration_id not in own:
                    continue
                heard.append((time.monotonic(), message.arbitration_id, bytes(message.data)))
                if message.arbitration_id == command and (message.data[7] >> 2) & 3 == 2:
                    enabled_at = min(enabled_at, time.monotonic())
            lasted = child.process.is_alive()
            for number in _children(child) if writer_too else ():
                os.kill(number, signal.SIGKILL)
            child.kill()
            while (message := bystander.recv(0)) is not None:
                if message.arbitration_id in own:
                    heard.append((time.monotonic(), message.arbitration_id, bytes(message.data)))
            _settled(log)
        if not lasted:
            raise RuntimeError(f"again, for the run ended by itself: {json.loads(child.ended()[1])['ended']}")
        logged = [(frame.id, frame.data) for frame in read_frames(log) if frame.direction == SENT]
        alike = run(["replay", str(log)]) == 0
    said = [(identifier, data) for _, identifier, data in heard]
    there = min(len(logged), len(said))
    lost_s = heard[-1][0] - heard[there][0] if there < len(said) else 0.0
    return Kill(after_s, len(said), max(len(said) - len(logged), 0), lost_s, said[:there] != logged[:there], alike)


def _children(child: Forked) -> list[int]:
    """The processes that `child` has begun."""
    found = list[int]()
    for place in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            parent = int(place.read_text().rpartition(")")[2].split()[1])
            found += [int(place.parent.name)] if parent == child.process.pid else []
    return found


def _settled(log: Path) -> None:
    """Wait until nothing is written any more."""
    size = -1
    while log.stat().st_size != size:
        size = log.stat().st_size
        time.sleep(_SETTLED_S)


def main() -> int:
    """Kill, print a line each, 1 where a log was not what it has to be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--latest", type=float, default=4.0)
    options = parser.parse_args()
    rng, found = random.Random(options.seed), list[Kill]()
    while len(found) < options.kills:
        writer_too = len(found) % 2 == 1
        try:
            found.append(kill(options.latest * rng.random(), writer_too))
        except RuntimeError as error:
            print(error, flush=True)
            continue
        print("with its writer" if writer_too else "alone", found[-1], flush=True)
    most, longest = max(one.missing for one in found), max(one.lost_s for one in found)
    good = sum(one.good for one in found)
    print(f"{len(found)} kills, {good} logs good, at most {most} frames missing, over {1e3 * longest:.0f} ms")
    return int(not all(one.good for one in found))


if __name__ == "__main__":
    sys.exit(main())
