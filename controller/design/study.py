"""The design of one rig: tuned PID and LQR, their margins, and simulated limit cycles with set-valued friction."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controller.baselines import LQR, Gains
from controller.design.describing_function import Balance, Describing, balances, compliance, describe, without_wall
from controller.design.tuning import PEAK, Complex, OpenLoop, Pid, pid_loop, state_loop, tuned_lqr, tuned_pid
from controller.drives import envelope_of
from controller.model.control_model import ControlModel
from controller.model.linear import PHASES, Linear, linearise
from controller.reference import SetpointMove
from controller.signals import Array, Estimate
from models.assembly.model import Assembly, assemble
from models.rigs.kinds import surface_of

STILL = 1e-6  # m, peak to peak: below it the loop rests
_LONGEST_STEP_S = 1e-3  # longest step of the simulation

Law = Callable[[float, Array, float, float], float]
"""Command for the tick at t in s from the state (n,) as seen and the reference's position in m and speed in m/s."""


@dataclass(frozen=True)
class LimitCycle:
    """The position error in the last half of a run; `period_s` is NaN without a repetition."""

    peak_to_peak_m: float
    period_s: float
    rms_m: float

    @property
    def hunts(self) -> bool:
        """Whether it repeats with more than a micrometre, peak to peak."""
        return self.peak_to_peak_m > STILL and math.isfinite(self.period_s)


@dataclass(frozen=True)
class LoopRun:
    """A simulated run: times (k,) in s, reference and position (k,) in m, command (k,)."""

    t: Array
    reference: Array
    position: Array
    command: Array

    def cycle(self) -> LimitCycle:
        """The periodic error in the last half of the run."""
        half = len(self.t) // 2
        error = (self.position - self.reference)[half:]
        swing = error - np.linspace(error[:50].mean(), error[-50:].mean(), len(error))
        rises = np.flatnonzero((swing[1:] > 0) & (swing[:-1] <= 0))
        tick = float(self.t[1] - self.t[0])
        period = float(np.mean(np.diff(rises))) * tick if len(rises) > 2 and float(np.ptp(error)) > STILL else math.nan
        return LimitCycle(float(np.ptp(error)), period, float(np.sqrt(np.mean(error**2))))


def pid_law(pid: Pid, tick_s: float, moves_along: bool) -> Law:
    """The PID in the loop; `moves_along`: the command starts from the reference's position (a carriage)."""
    system = pid.system(tick_s)
    memory = np.zeros((2, 1))

    def law(t: float, state: Array, r: float, speed: float) -> float:
        nonlocal memory
        error = r - state[0]
        command = float(np.squeeze(system.C @ memory + system.D * error)) + (r if moves_along else 0.0)
        memory = system.A @ memory + system.B * error
        return command

    return law


def lqr_law(lqr: LQR) -> Law:
    """The LQR in the loop, on delayed states."""

    def law(t: float, state: Array, r: float, speed: float) -> float:
        reference = SetpointMove(*np.array([[t], [r], [speed], [0.0]]))
        return lqr.act(t, Estimate(t, state, np.zeros_like(state)), reference).command

    return law


def simulate(
    model: ControlModel,
    law: Law,
    speed_m_s: float,
    seconds: float,
    hold_s: float,
    delay_s: float,
    exact: Assembly | None = None,
) -> LoopRun:
    """Run `law`, with states `delay_s` late, on `model` with set-valued friction (`exact`, `exactly(model)` if None):
    `seconds` at `speed_m_s`, then a hold of `hold_s`; one sample per tick.
    """
    exact = exactly(model) if exact is None else exact
    p, state, tick = exact.vector(model.theta), exact.start(), model.tick_s
    seen = np.array([exact.states.index(name) for name in model.states])
    steps = max(1, math.ceil(tick / _LONGEST_STEP_S - 1e-9))
    count = int((seconds + hold_s) / tick)
    kept = math.ceil(delay_s / tick - 1e-9) + 1
    late: deque[Array] = deque([state[seen]] * kept, maxlen=kept)
    t = np.arange(count, dtype=np.float64) * tick
    reference: Array = np.asarray(speed_m_s * np.minimum(t, seconds), dtype=np.float64)
    position, commands = np.zeros(count), np.zeros(count)
    for k in range(count):
        late.append(state[seen])
        command = law(float(t[k]), late[0], float(reference[k]), speed_m_s if t[k] < seconds else 0.0)
        position[k], commands[k] = state[0], command
        for i in range(steps):
            state = np.asarray(exact.step(state, command, command, t[k] + i * tick / steps, tick / steps, p)[0]).ravel()
    return LoopRun(t, reference, position, commands)


def exactly(model: ControlModel) -> Assembly:
    """The same parts with set-valued friction."""
    return assemble(surface_of(model.rig), model.drive, model.symbols.effects)


RAMP_S, HOLD_S = 5.0, 4.0  # s at a constant speed, and s held after it


@dataclass(frozen=True)
class Study:
    """The designs for `speed_m_s` with measurements `delay_s` old: `runs` and `cycles` by controller and by "ramp" and
    "hold", the `wall`'s describing function with the plant `free` of the wall.
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
        return {name: {part: run.cycle() for part, run in parts.items()} for name, parts in self.runs.items()}

    def laws(self) -> dict[str, Pid | Gains]:
        return {"pid": self.pid, "lqr": self.lqr}

    def balances(self) -> dict[str, list[Balance]]:
        return {name: balances(self.wall, self.free, law, self.delay_s) for name, law in self.laws().items()}

    def compliance(self, name: str) -> Complex:
        """Motion of the capsule per force under the controller `name` without a wall, m/N at the wall's `omega`."""
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
