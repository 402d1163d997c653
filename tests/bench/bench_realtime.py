"""Real time between processes: what a bus loses in a burst, its round trip, and a controller that leads a plant at 500 Hz under load.

python -m tests.bench.bench_realtime                     # buses, then 10 minutes
python -m tests.bench.bench_realtime --seconds 20        # shorter
python -m tests.bench.bench_realtime --buses             # buses alone; udp_multicast needs the package msgpack
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import numpy as np

from hil.bus.catalogue import load_catalogue
from hil.bus.log_reading import read_frames
from tests.hil.deployments import PLANT, deployment

BURST, PAUSED_S, TRIPS, FIRST_TRIPS, ANSWER_S = 2000, 0.3, 2000, 10, 0.2
NEEDS = {
    "udp_multicast": "; needs the package msgpack and a route, as by ip link set lo multicast on; ip route add 239.0.0.0/8 dev lo"
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
    """Of `BURST` frames sent at once or 4 a millisecond to a reader that reads or pauses for a moment: how many are lost in percent, and how
    many of them `send` tells of; and the round trip of single frames in ms. Raises ValueError where no frame reaches another process."""
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
    """Send `BURST` frames, `together` of them and then nothing for 1 ms; how many the sender heard that they were not taken."""
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
        far = subprocess.Popen([sys.executable, "-c", FAR, interface, channel, str(pause)], stdout=subprocess.PIPE, text=True)
        try:
            if far.stdout is None or far.stdout.readline() != "ready\n":
                raise ValueError("must open in another process; it did not")
            yield far, bus
        finally:
            far.kill()
            far.communicate()


def bare_figures(seconds: float, priority: int) -> dict[str, float]:
    """How late a process that does nothing but sleep to the next 2 ms wakes up here, in ms: what no program can better."""
    code = (
        "import json, sys\nfrom hil.app.run_clock import Clock, Grid\nfrom hil.app.run_loop import prepare_process\n"
        "prepare_process(int(sys.argv[2]), -1)\ngrid = Grid(Clock(), 0.002)\n"
        "while grid.ticks < float(sys.argv[1]) / 0.002:\n    grid.wait()\n"
        "print(json.dumps({**grid.late.document(), 'missed': grid.missed}))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(seconds), str(priority)], capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def lead_figures(seconds: float, priority: int, load: bool, controller: str) -> dict[str, object]:
    """What `capsule run` says of `seconds` with a plant in another process, what the plant says, and the round trip in ms from SYNC to the
    drive's feedback that follows it (the drive's firmware runs every 1 ms by its own clock, so 1 ms of it is the drive's)."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        channel = f"bench-{folder.name}"
        (folder / "plant.toml").write_text(PLANT)
        table = f'duration_s = {seconds}\npriority = {priority}\ncontroller = "{controller}"'
        text = deployment(channel, control=table, more="").replace('kind = "ramp"\nspeed_mm_s = 2.0', SINE)
        (folder / "rig.toml").write_text(text)
        log = folder / "run.blf"
        arguments = ["capsule_local", channel, str(seconds + 60), str(priority)]
        plant = subprocess.Popen(
            [sys.executable, "-m", "hil.app.run_plant", str(folder / "plant.toml"), *arguments], stdout=subprocess.PIPE, text=True
        )
        burner = subprocess.Popen([sys.executable, "-c", LOAD]) if load else None
        assert plant.stdout is not None
        plant.stdout.readline()
        command = [sys.executable, "-m", "hil.app.main", "run", str(folder / "rig.toml"), "--log", str(log), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        plant.terminate()
        truth = json.loads(plant.communicate()[0])
        if burner is not None:
            burner.kill()
            burner.wait()
        replayed = subprocess.run(
            [sys.executable, "-m", "hil.app.main", "replay", str(log)], capture_output=True, text=True, check=False
        )
        return {"run": json.loads(done.stdout), "plant": truth, "trip_ms": _trips(log), "replay": replayed.stdout.strip()}


SINE = 'kind = "sine"\namplitude_mm = 5.0\nfrequency_Hz = 0.125'


def _trips(log: Path) -> dict[str, float]:
    catalogue = load_catalogue()
    numbers = {catalogue["Sync"].id: list[int](), catalogue["CarriageFeedback"].id: list[int]()}
    for frame in read_frames(log):
        if frame.id in numbers:
            numbers[frame.id].append(frame.time_ns)
    asked, answered = (np.array(times) for times in numbers.values())
    answered.sort()
    asked = asked[(asked >= answered[0]) & (asked < answered[-1])] if answered.size else asked[:0]
    trips = 1e-6 * (answered[np.searchsorted(answered, asked)] - asked)
    return (
        {"median": float(np.median(trips)), "p99": float(np.quantile(trips, 0.99)), "max": float(trips.max())}
        if trips.size
        else {}
    )


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--priority", type=int, default=50)
    parser.add_argument("--controller", default="mpc")
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
        print(json.dumps(lead_figures(options.seconds, options.priority, not options.no_load, options.controller), indent=2))


if __name__ == "__main__":
    main()
