"""Real time between processes: what a bus loses in a burst, its round trip, and a controller that leads a plant at 500
Hz under load.

python -m tests.bench.bench_realtime                     # buses, then 10 minutes
python -m tests.bench.bench_realtime --seconds 20        # shorter
python -m tests.bench.bench_realtime --buses             # buses alone; udp_multicast needs the package msgpack

A machine that is away for longer than a command lives ends a run, as it must. The time is then led on in a further run,
as an operator would start it, up to `--runs` of them. On each core a witness that only sleeps tells when the machine
was away (`tests.bench.witness`); commands that were missed, and ends, with no witness away at that time are the
program's own and counted apart.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
import numpy as np
from numpy.typing import NDArray

from hil.bus.catalogue import load_catalogue
from hil.log.blf_file import NOTED
from hil.log.reader import read_frames, read_log_record
from hil.log.recorder import START, STOP
from tests.bench.witness import witnesses
from tests.hil.app.run.deployments import PLANT, deployment

TICK_NS, SLACK_NS = 2_000_000, 200_000
BEFORE_END_NS = 50_000_000  # twice what a carriage's node waits at most before it stops
BURST, PAUSED_S, TRIPS, FIRST_TRIPS, ANSWER_S = 2000, 0.3, 2000, 10, 0.2
NEEDS = {
    "udp_multicast": (
        "; needs the package msgpack and a route, as by ip link set lo multicast on; ip route add 239.0.0.0/8 dev lo"
    )
}
FAR = """
import sys, time, can
bus = can.Bus(interface=sys.argv[1], channel=sys.argv[2] or None)
print("ready", flush=True)
count, last = 0, time.monotonic()
while time.monotonic() - last < 2:
    message = bus.recv(0.5)
    if message is None:
        continue
    last = time.monotonic()
    if message.arbitration_id == 1:
        bus.send(can.Message(arbitration_id=2, is_extended_id=False, data=message.data))
    else:
        count += 1
        if count == 1:
            time.sleep(float(sys.argv[3]))
print(count, flush=True)
bus.shutdown()
"""
LOAD = """
import os, time
parent = os.getppid()
while os.getppid() == parent:
    t = time.perf_counter()
    while time.perf_counter() - t < 0.0033:
        pass
    time.sleep(0.0067)
"""


def bus_figures(interface: str, channel: str) -> dict[str, float]:
    """Of `BURST` frames sent at once or 4 a millisecond to a reader that reads or pauses for a moment: how many are
    lost in percent, and how many of them `send` tells of; and the round trip of single frames in ms. Raises ValueError
    where no frame reaches another process.
    """
    with _far(interface, channel, 0.0) as (_, bus):
        if all(math.isinf(_trip(bus)) for _ in range(FIRST_TRIPS)):
            raise ValueError("must carry frames to another process and back; none came")
        trips = np.array([_trip(bus) for _ in range(TRIPS)])
    came = trips[np.isfinite(trips)]
    median, p99 = (1e3 * float(np.quantile(came, q)) for q in (0.5, 0.99))
    found = {"trip_median_ms": median, "trip_p99_ms": p99, "trips_lost": int(trips.size - came.size)}
    for name, together, pause in (
        ("at once", BURST, 0.0),
        ("spread", 4, 0.0),
        (f"spread, reader away {PAUSED_S:g} s", 4, PAUSED_S),
    ):
        with _far(interface, channel, pause) as (far, bus):
            told = _burst(bus, together)
            got = int(far.stdout.readline()) if far.stdout else 0
        found |= {f"{name}: lost_percent": round(100 * (1 - got / BURST), 2), f"{name}: told_of": told}
    return found


def _burst(bus: can.BusABC, together: int) -> int:
    """Send `BURST` frames, `together` of them and then nothing for 1 ms; how many the sender heard that they were not
    taken.
    """
    before, refused = getattr(bus, "overruns", 0), 0
    for k in range(BURST):
        try:
            bus.send(can.Message(arbitration_id=3, is_extended_id=False, data=k.to_bytes(8, "little")))
        except can.CanError:
            refused += 1
        if (k + 1) % together == 0:
            time.sleep(0.001)
    return refused + getattr(bus, "overruns", 0) - before


def _trip(bus: can.BusABC) -> float:
    """Seconds until another process has answered, infinite where it does not."""
    began = time.perf_counter()
    bus.send(can.Message(arbitration_id=1, is_extended_id=False, data=bytes(8)))
    while (answer := bus.recv(ANSWER_S)) is not None and answer.arbitration_id != 2:
        pass
    took = time.perf_counter() - began
    time.sleep(0.0005)
    return took if answer is not None else math.inf


@contextmanager
def _far(interface: str, channel: str, pause: float) -> Iterator[tuple[subprocess.Popen[str], can.BusABC]]:
    with can.Bus(interface=interface, channel=channel or None) as bus:
        far = subprocess.Popen(
            [sys.executable, "-c", FAR, interface, channel, str(pause)], stdout=subprocess.PIPE, text=True
        )
        try:
            if far.stdout is None or far.stdout.readline() != "ready\n":
                raise ValueError("must open in another process; it did not")
            yield far, bus
        finally:
            far.kill()
            far.communicate()


def bare_figures(seconds: float, priority: int) -> dict[str, float]:
    """How late a process that does nothing but sleep to the next 2 ms wakes up here, in ms: what no program can
    better.
    """
    code = (
        "import json, sys\nfrom hil.app.run.clock import Clock, Grid\nfrom hil.app.run.machine import prepare_process\n"
        "prepare_process(int(sys.argv[2]), -1)\ngrid = Grid(Clock(), 0.002)\n"
        "while grid.ticks < float(sys.argv[1]) / 0.002:\n    grid.wait()\n"
        "print(json.dumps({**grid.late.document(), 'missed': grid.missed}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(seconds), str(priority)], capture_output=True, text=True, check=True
    )
    return dict(json.loads(done.stdout))


def long_figures(seconds: float, runs: int, priority: int, load: bool, controller: str) -> dict[str, object]:
    """`seconds` of leading in as few runs as the machine allows, at most `runs`, and what of the misses the witnesses
    explain.
    """
    found: list[Run] = []
    with witnesses() as seen:
        while len(found) < runs and (left := seconds - sum(run.led_s for run in found)) > 0.1:
            found.append(lead_figures(left, priority, load, controller))
    gaps = [gap for run in found for gap in run.gaps()]
    unseen = [gap for gap in gaps if seen.longest(*gap) == 0]
    ends = [run for run in found if run.says["ended"] != "done"]
    trips = np.concatenate([run.trips_ms for run in found])
    return {
        "led_s": round(sum(run.led_s for run in found), 1),
        "longest_run_s": round(max(run.led_s for run in found), 1),
        "commands": sum(run.sent_ns.size for run in found),
        "gaps": len(gaps),
        "gaps_the_witnesses_do_not_explain": [round((end - begin) / 1e6, 2) for begin, end in unseen],
        "ends": [
            {
                "after_s": round(run.led_s, 1),
                "ended": run.says["ended"],
                "without_feedback_ms": round((run.end_ns - run.heard_ns) / 1e6, 1),
                "machine_away_ms": round(seen.longest(run.end_ns - BEFORE_END_NS, run.end_ns), 1),
            }
            for run in ends
        ],
        "late_ms_p99": max(run.says["late_ms"]["p99"] for run in found),
        "tick_ms_p99": max(run.says["tick_ms"]["p99"] for run in found),
        "trip_ms": {
            name: round(float(np.quantile(trips, share)), 3)
            for name, share in (("median", 0.5), ("p99", 0.99), ("max", 1.0))
            if trips.size
        },
        "overruns": sum(run.says["overruns"] for run in found),
        "rejected": sum(run.says["rejected"] for run in found),
        "log_dropped": sum(run.says["log_dropped"] for run in found),
        "replayed_alike": sum(run.alike for run in found),
        "runs": len(found),
        "witnesses": {
            "go_first": seen.first,
            "away": len(seen.away),
            "longest_ms": round(max((a.ms for a in seen.away), default=0.0), 1),
            "share_percent": round(100 * sum(a.ms for a in seen.away) / 1e3 / max(seen.cores * seen.stood_s, 1e-9), 3),
        },
    }


@dataclass(frozen=True)
class Run:
    """One `capsule run`: what it `says`, when its commands went out, when the drive was last heard before it stopped
    and when it stopped (ns of the machine's monotonic clock), the round trips in ms from SYNC to the drive's feedback
    that follows (the drive's firmware runs every 1 ms by its own clock, so 1 ms of it is the drive's), and whether its
    replay was `alike`.
    """

    says: dict[str, Any]
    sent_ns: NDArray[np.int64]
    heard_ns: int
    end_ns: int
    trips_ms: NDArray[np.float64]
    alike: bool

    @property
    def led_s(self) -> float:
        """From the first command to the last."""
        return float(np.ptp(self.sent_ns)) / 1e9 if self.sent_ns.size else 0.0

    def gaps(self) -> list[tuple[int, int]]:
        """Where a command or more is missing: no command began in a whole period of the grid that the first one
        began.
        """
        period = (self.sent_ns - self.sent_ns[:1] + SLACK_NS) // TICK_NS
        far = np.flatnonzero(np.diff(period) > 1)
        return [(int(self.sent_ns[k]), int(self.sent_ns[k + 1])) for k in far]


def lead_figures(seconds: float, priority: int, load: bool, controller: str) -> Run:
    """One run of at most `seconds`, with a plant in another process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        channel = f"bench-{folder.name}"
        (folder / "plant.toml").write_text(PLANT)
        table = f'duration_s = {seconds}\npriority = {priority}\ncontroller = "{controller}"'
        text = deployment(channel, control=table, more="").replace('kind = "ramp"\nspeed_mm_s = 2.0', SINE)
        (folder / "rig.toml").write_text(text)
        log = folder / "run.blf"
        named = f'[plant]\nscenario = "plant.toml"\npriority = {priority}\n'
        (folder / "plant_side.toml").write_text(deployment(channel, more=named))
        arguments = [str(folder / "plant_side.toml"), "--seconds", str(seconds + 60), "--json"]
        plant = subprocess.Popen(
            [sys.executable, "-m", "hil.app.start", "plant", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        burner = subprocess.Popen([sys.executable, "-c", LOAD]) if load else None
        assert plant.stderr is not None
        plant.stderr.readline()
        command = [sys.executable, "-m", "hil.app.start", "run", str(folder / "rig.toml"), "--log", str(log), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        plant.terminate()
        truth = json.loads(plant.communicate()[0])
        if burner is not None:
            burner.kill()
            burner.wait()
        replayed = subprocess.run(
            [sys.executable, "-m", "hil.app.start", "replay", str(log)], capture_output=True, text=True, check=False
        )
        says = dict(json.loads(done.stdout))
        print(
            f"run of {says['ticks'] * TICK_NS / 1e9:.1f} s: {says['ended']}; plant late ms {truth['late_ms']};"
            f" {replayed.stdout.strip()}",
            flush=True,
        )
        sent, heard, ended, trips = _frames_of(log)
        origin = int(read_log_record(log)["clock_origin_ns"])
        return Run(says, sent + origin, heard + origin, ended + origin, trips, replayed.returncode == 0)


SINE = 'kind = "sine"\namplitude_mm = 5.0\nfrequency_Hz = 0.125'


def _frames_of(log: Path) -> tuple[NDArray[np.int64], int, int, NDArray[np.float64]]:
    """When the commands went out between the operator's start and the stop, the last feedback before that and the stop,
    ns; round trips in ms.
    """
    catalogue = load_catalogue()
    asking, answering, command = (catalogue[name].id for name in ("Sync", "CarriageFeedback", "CarriageCommand"))
    asked, answered, sent = list[int](), list[int](), list[int]()
    leads, heard, ended = False, 0, 0
    for frame in read_frames(log):
        if frame.direction == NOTED:
            if frame.id == STOP and leads:
                ended = frame.time_ns
            leads = frame.id == START or (leads and frame.id != STOP)
        elif frame.id == answering:
            answered.append(frame.time_ns)
            heard = frame.time_ns if leads else heard
        elif frame.id == asking:
            asked.append(frame.time_ns)
        elif frame.id == command and leads:
            sent.append(frame.time_ns)
    came, began = np.sort(np.array(answered, dtype=np.int64)), np.array(asked, dtype=np.int64)
    first = np.searchsorted(came, began)
    whole = (first > 0) & (first < came.size)
    return np.array(sent, dtype=np.int64), heard, ended, 1e-6 * (came[first[whole]] - began[whole]).astype(np.float64)


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--priority", type=int, default=50)
    parser.add_argument("--controller", default="mpc")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--no-load", action="store_true")
    parser.add_argument("--buses", action="store_true")
    options = parser.parse_args()
    buses = (("capsule_local", "bench"), ("udp_multicast", "239.74.163.2"))
    for interface, channel in buses if options.seconds >= 600 or options.buses else ():
        try:
            print(interface, json.dumps(bus_figures(interface, channel)))
        except (ValueError, can.CanError, OSError) as error:
            print(f"{interface}: {error}{NEEDS.get(interface, '')}")
    if not options.buses:
        print("bare", json.dumps(bare_figures(min(options.seconds, 60.0), options.priority)))
        found = long_figures(options.seconds, options.runs, options.priority, not options.no_load, options.controller)
        print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
