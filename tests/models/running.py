"""Runs an assembled model through a command at the speed of compiled code; any state may be watched beside the
output.
"""

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from models.assembly.model import Assembly
from models.compiled.kernel import Kernel
from models.parameter import Name

Array = NDArray[np.float64]


def watching(assembly: Assembly, state: Name) -> ca.Function:
    """The model's step with `state` at the step's end in the output's place."""
    symbols = assembly.step.sx_in()
    new, _ = assembly.step(*symbols)
    return ca.Function("step", symbols, [new, new[assembly.states.index(state)]])


def run(
    assembly: Assembly,
    command: Array,
    dt: float,
    substeps: int = 1,
    values: Mapping[Name, float] | None = None,
    watch: Name = "",
    **start: float,
) -> Array:
    """The output, one value a sample of `command` (linear in between, `dt` s apart), or the state `watch` in its
    place.
    """
    kernel = Kernel(watching(assembly, watch) if watch else assembly.step, assembly.correct)
    output = np.zeros(command.size)
    state = assembly.start(**start)
    kernel.one(state, np.asarray(command, float), output, 0.0, assembly.vector(values or {}), substeps, dt, output)
    return output


def stepped(assembly: Assembly, command: Array, dt: float, values: Mapping[Name, float] | None = None) -> Array:
    """The same as `run` for short commands, by CasADi's own machine: nothing to compile."""
    before = np.concatenate([command[:1], command[:-1]])
    n = command.size
    chain = assembly.step.mapaccum(n)
    times = dt * np.arange(-1.0, n - 1)
    _, output = chain(
        assembly.start(), before, command, times, dt, np.tile(assembly.vector(values or {})[:, None], (1, n))
    )
    return np.array(output).ravel()


def pulses(period_s: float, duty: float, periods: int, dt: float) -> Array:
    """On (1) for `duty` of each period, then off (0): each sample's mean over the step after it, so that on-times are
    exact.
    """
    turns = np.arange(round(periods * period_s / dt) + 2) * (dt / period_s)
    on = np.floor(turns) * duty + np.minimum(turns - np.floor(turns), duty)
    return np.asarray(np.diff(on) * (period_s / dt))
