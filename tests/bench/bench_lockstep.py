"""How fast a closed loop over the simulated bus runs in lockstep: `python -m tests.bench.bench_lockstep [SECONDS]
[SCENARIO.toml]`.

Simulated seconds a second of processor time and of the wall clock, a line a controller, all nodes and the wire in one
process at 500 Hz. What else the machine does slows the processor too, so compare numbers of one run.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

from controller.registry import leads
from hil.app.scenario.bus_scenario import load_sil_scenario
from hil.app.sil.loop import run_sil
from hil.app.sil.testbed import believed_on_bus
from models.theta import Theta

SHIPPED = Path(__file__).parents[2] / "hil" / "scenarios" / "track_magnetic_ramp.toml"
CONTROLLERS = ("pid_friction", "feedforward", "mpc", "vibro")


def main(seconds: float, path: Path) -> None:
    """Print the table; the first run of each controller, in which machine code is made, does not count."""
    scenario, _ = load_sil_scenario(path)
    scenario = replace(scenario, loop=replace(scenario.loop, duration_s=seconds))
    model = believed_on_bus(scenario, Theta())
    print(f"{scenario.loop.name}, {seconds:g} s\ncontroller      x real time: processor, wall   frames/s  load")
    for controller in (name for name in CONTROLLERS if scenario.loop.kind in leads(name)):
        run_sil(replace(scenario, loop=replace(scenario.loop, duration_s=0.5)), model, controller, 1)
        used, began = time.process_time(), time.perf_counter()
        trace = run_sil(scenario, model, controller, 1)
        used, wall = time.process_time() - used, time.perf_counter() - began
        print(
            f"{controller:15s} {seconds / used:22.1f} {seconds / wall:6.1f} {trace.frames / seconds:10.0f}"
            f" {trace.load:6.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0, Path(sys.argv[2]) if len(sys.argv) > 2 else SHIPPED)
