"""One rig's design: tuned PID and LQR on the plant stuck and slipping, their margins, and whether they hunt."""

from dataclasses import dataclass

from controller.baselines.lqr import LQR, Gains
from controller.design.describing_function import Balance, Describing, balances, compliance, describe, without_wall
from controller.design.limit_cycle import LimitCycle, LoopRun, exactly, lqr_law, pid_law, simulate
from controller.design.margins import Complex, OpenLoop
from controller.design.tuning import PEAK, Pid, pid_loop, state_loop, tuned_lqr, tuned_pid
from controller.drives import envelope_of
from controller.model.control_model import ControlModel
from controller.model.linear import PHASES, Linear, linearise

RAMP_S, HOLD_S = 5.0, 4.0  # s at a constant speed, and s held after it


@dataclass(frozen=True)
class Study:
    """What was designed for `speed_m_s` with measurements `delay_s` old: `runs` and `cycles` by controller and by
    "ramp" and "hold", the `wall`'s describing function with the plant `free` of the wall that stands across from it.
    """

    speed_m_s: float
    delay_s: float
    plants: tuple[Linear, ...]
    pid: Pid
    lqr: Gains
    loops: tuple[OpenLoop, ...]
    runs: dict[str, dict[str, LoopRun]]
    wall: Describing
    free: Linear

    def cycles(self) -> dict[str, dict[str, LimitCycle]]:
        """How each controller's error repeats."""
        return {name: {part: run.cycle() for part, run in parts.items()} for name, parts in self.runs.items()}

    def laws(self) -> dict[str, Pid | Gains]:
        """The controllers by name."""
        return {"pid": self.pid, "lqr": self.lqr}

    def balances(self) -> dict[str, list[Balance]]:
        """The cycles at rest that the harmonic balance has for each controller."""
        return {name: balances(self.wall, self.free, law, self.delay_s) for name, law in self.laws().items()}

    def compliance(self, name: str) -> Complex:
        """What a force does to the capsule under the controller `name` without a wall, m/N at the wall's `omega`."""
        return compliance(self.free, self.laws()[name], self.wall.omega, self.delay_s)


def study(model: ControlModel, speed_m_s: float = 1e-3, delay_s: float = 0.015, peak: float = PEAK) -> Study:
    """Design for `model`. Raises ValueError for an inner-mass drive, numbers out of range, an unreachable `peak`."""
    if not 1e-5 <= abs(speed_m_s) <= 0.1:
        raise ValueError(f"speed must lie in [1e-5, 0.1] m/s; got {speed_m_s:g}")
    if not 0 <= delay_s <= 0.2:
        raise ValueError(f"delay must lie in [0, 0.2] s; got {delay_s:g}")
    if not 1 < peak <= 10:
        raise ValueError(f"sensitivity peak must lie in (1, 10]; got {peak:g}")
    plants = tuple(linearise(model, phase, speed_m_s) for phase in PHASES)
    pid, gains = tuned_pid(plants, delay_s, peak), tuned_lqr(plants, plants[-1], delay_s, peak)
    pairs = ((pid_loop(plant, pid, delay_s), state_loop(plant, gains, delay_s)) for plant in plants)
    loops = tuple(loop for pair in pairs for loop in pair)
    exact, envelope = exactly(model), envelope_of(model.drive)
    runs: dict[str, dict[str, LoopRun]] = {"pid": {}, "lqr": {}}
    for part, moving_s, hold_s in (("ramp", RAMP_S, 0.0), ("hold", 1.0, HOLD_S)):
        laws = {"pid": pid_law(pid, model.tick_s, model.drive.anchored), "lqr": lqr_law(LQR(model, envelope, gains))}
        for name, law in laws.items():
            runs[name][part] = simulate(model, law, speed_m_s, moving_s, hold_s, delay_s, exact)
    return Study(speed_m_s, delay_s, plants, pid, gains, loops, runs, describe(model), without_wall(model))
