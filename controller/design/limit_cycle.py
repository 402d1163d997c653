"""Does the loop hunt? Simulated with set-valued friction and without noise: slow motion, then a hold."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controller.baselines.lqr import LQR
from controller.design.tuning import Pid
from controller.model.control_model import ControlModel
from controller.move import SetpointMove
from controller.signals import Array, Estimate
from models.assembly.model import Assembly, assemble
from models.rigs.kinds import surface_of

STILL = 1e-6  # m, peak to peak: below it the loop rests
_LONGEST_STEP_S = 1e-3  # longest step of the simulation

Law = Callable[[float, Array, float, float], float]
"""Command of a controller for the tick at t in s from the state (n,) as it is seen, the reference's position in m and
speed in m/s.
"""


@dataclass(frozen=True)
class LimitCycle:
    """The position error in the last half of a run; `period_s` is NaN without a repetition."""

    peak_to_peak_m: float
    period_s: float
    rms_m: float

    @property
    def hunts(self) -> bool:
        """Whether it goes to and fro by more than a micrometre; one that still settles does not."""
        return self.peak_to_peak_m > STILL and math.isfinite(self.period_s)


@dataclass(frozen=True)
class LoopRun:
    """A simulated run: times (k,) in s, reference and position (k,) in m, command (k,)."""

    t: Array
    reference: Array
    position: Array
    command: Array

    def cycle(self) -> LimitCycle:
        """How the error of the last half of the run repeats."""
        half = len(self.t) // 2
        error = (self.position - self.reference)[half:]
        swing = error - np.linspace(error[:50].mean(), error[-50:].mean(), len(error))
        rises = np.flatnonzero((swing[1:] > 0) & (swing[:-1] <= 0))
        tick = float(self.t[1] - self.t[0])
        period = float(np.mean(np.diff(rises))) * tick if len(rises) > 2 and float(np.ptp(error)) > STILL else math.nan
        return LimitCycle(float(np.ptp(error)), period, float(np.sqrt(np.mean(error**2))))


def pid_law(pid: Pid, tick_s: float, moves_along: bool) -> Law:
    """The PID as it runs; `moves_along`: the command starts from the reference's position (a carriage)."""
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
    """The LQR as it runs, on states that are seen late."""

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
    """Run `law`, which sees states `delay_s` late, on `model` with friction that holds a resting capsule (`exact`,
    `exactly(model)` where None): `seconds` at `speed_m_s`, then a hold of `hold_s`; one sample a tick.
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
