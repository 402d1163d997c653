"""The control model linearised for a sliding capsule, with the wall sticking to it or slipping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from controller.model.control_model import ControlModel
from controller.signals import Array
from models.parameter import Name
from models.theta import bare

if TYPE_CHECKING:
    import control

Phase = Literal["stick", "slip", "averaged"]
PHASES: tuple[Phase, ...] = ("stick", "slip")
_MEMORIES = ("direction", "travelled", "slip")
_WIDEST = 1e3  # largest command, in its unit, of the search for a sliding capsule


@dataclass(frozen=True)
class Linear:
    """Deviations from sliding at `speed_m_s` under `command` with the wall in `phase`: `z+ = A z + B u + E d`, one
    tick. `states` are the model's without memories and wall; the pull of a sticking wall is in A's column of x. A (n,
    n), B (n, 1), E (n, 1) for a force in N; x and v come first.
    """

    phase: Phase
    speed_m_s: float
    command: float
    tick_s: float
    states: tuple[Name, ...]
    A: Array
    B: Array
    E: Array

    def system(self) -> control.StateSpace:
        """From the command to x, discrete in time."""
        import control  # it imports matplotlib, which takes a second

        return control.ss(self.A, self.B, np.eye(1, len(self.states)), 0.0, self.tick_s)

    def response(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """States (n, k) per command at the points `z` (k,): `(z I - A)^-1 B`."""
        n = len(self.states)
        found = np.linalg.solve(z[:, None, None] * np.eye(n) - self.A, np.broadcast_to(self.B, (len(z), n, 1)))
        return np.asarray(found[..., 0].T, dtype=np.complex128)

    def rates(self) -> Array:
        """Poles as continuous rates in 1/s, `log(eigenvalue)/tick`, slowest first, without poles at 0."""
        poles = np.linalg.eigvals(self.A)
        rates = np.log(poles[np.abs(poles) > 1e-12].astype(complex)) / self.tick_s
        return np.asarray(rates[np.argsort(np.abs(rates))])

    def holding(self) -> tuple[Array, float]:
        """States (n,) and command of a rest at x = 1 m: `(A - I) z + B u = 0`, smallest solution."""
        n = len(self.states)
        left = np.block([[self.A - np.eye(n), self.B], [np.eye(1, n), np.zeros((1, 1))]])
        found = np.linalg.lstsq(left, np.r_[np.zeros(n), 1.0], rcond=None)[0]
        return found[:n], float(found[n])


def linearise(model: ControlModel, phase: Phase, speed_m_s: float = 1e-3) -> Linear:
    """Linearise one tick of `model` for a capsule that slides at `speed_m_s` under the command that keeps it, the
    wall's pull at half its slip limit. At rest friction is set-valued and small commands move nothing. Raises
    ValueError for an inner mass, whose body reverses in every cycle, and if no command keeps the speed.
    """
    if model.drive.turning:
        raise ValueError(
            "drive must move the capsule steadily to be linearised;"
            f" got {model.drive.name!r}, whose body reverses in every cycle"
        )
    state = _sliding(model, phase, speed_m_s)
    command = _balancing(model, state)
    state = _followed(model, state, command)
    _, *slopes = model.jacobians(state, command, 0.0, 0.0)
    A, B, E = (np.array(s, dtype=float) for s in slopes)
    if "u" in model.states and phase == "stick":
        A[:, model.index("x")] += A[:, model.index("u")]
    left_out = (*_MEMORIES, "u")
    kept = [k for k, name in enumerate(model.states) if name not in left_out and bare(name) != "travelled"]
    names = tuple(model.states[k] for k in kept)
    return Linear(phase, speed_m_s, command, model.tick_s, names, A[np.ix_(kept, kept)], B[kept], E[kept])


def _sliding(model: ControlModel, phase: Phase, speed_m_s: float) -> Array:
    state, way = model.initial(), float(np.sign(speed_m_s) or 1.0)
    state[model.index("v")] = speed_m_s
    if "direction" in model.states:
        state[model.index("direction")] = way
    if "u" in model.states:
        state[model.index("u")] = 0.5 * way * _slip_drag(model, state)
        state[model.index("slip")] = 0.0 if phase == "stick" else way
    return state


def _slip_drag(model: ControlModel, state: Array) -> float:
    """Wall drag in m at which the wall begins to slip: where a tick of pure dragging leaves the stick mode."""
    reach = np.linspace(1e-5, 2e-3, 200)
    for u in reach:
        trial = state.copy()
        trial[model.index("u")] = u
        if float(model.step(trial, 0.0, 0.0, 0.0)[model.index("slip")]) != 0:
            return float(u)
    return float(reach[-1])


def _balancing(model: ControlModel, state: Array) -> float:
    """The command under which the capsule keeps its speed for a tick; drive states follow it."""
    v, most = model.index("v"), model.drive.gap_limit_m

    def gained(command: float) -> float:
        return float(model.step(_followed(model, state, command), command, 0.0, 0.0)[v]) - float(state[v])

    if most is None:
        most = 1e-3
        while most < _WIDEST and gained(-most) * gained(most) > 0:
            most *= 2
    if gained(-most) * gained(most) > 0:
        raise ValueError(
            f"drive must be able to keep the capsule at {state[v]:g} m/s; got a resistance beyond its greatest force"
        )
    return float(scipy.optimize.brentq(gained, -most, most, xtol=1e-12))


def _followed(model: ControlModel, state: Array, command: float) -> Array:
    """`state` with the drive's states after a long time under `command`: a current after 0.2 s."""
    state = state.copy()
    for k, name in enumerate(model.states):
        if model.followed_by(name) == "command":
            state[k] = command
        elif bare(name) == "current_A":
            trial = state.copy()
            for _ in range(max(1, int(0.2 / model.tick_s))):
                before, trial[k] = trial[k], float(model.step(trial, command, 0.0, 0.0)[k])
                if abs(trial[k] - before) <= 1e-12 * max(abs(trial[k]), 1.0):
                    break
            state[k] = trial[k]
    return state
