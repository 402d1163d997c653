"""Does the loop hunt? Harmonic balance: its response to a force against the first harmonic of stick and slip. If that
has an unstable cycle of amplitude A, the loop comes to rest from less and diverges from more: friction, whose
describing function falls as 1/A, no longer damps it. A stable cycle is hunting.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from controller.baselines import Gains
from controller.design.tuning import Complex, Pid, feedback
from controller.model.control_model import ControlModel
from controller.model.linear import Linear, linearise
from controller.model.symbols import assembled
from controller.signals import Array
from models.assembly.model import assemble
from models.compiled.kernel import Kernel
from models.drives.pull import Pull
from models.rigs.kinds import surface_of
from models.surfaces.surface import Plate

AMPLITUDES_M = np.geomspace(1e-5, 3e-3, 24)
FREQUENCIES_HZ = np.geomspace(0.1, 40.0, 20)
_SETTLE, _MEASURE = 2, 4  # cycles
_STEPS, _LONGEST_STEP_S = 1024, 2e-3  # least steps of a period, and the longest
_APART = 1e-3  # step in a cycle's logarithms for the slopes of F
_FINE = 4  # refinement of the wall's table for the search of cycles


@dataclass(frozen=True)
class Describing:
    """The wall under an imposed `x = A sin(omega t)`: the first harmonic of its resistance is `N(A, omega) x`, `N` (a,
    w) in N/m complex over `amplitude_m` (a,) and `omega` (w,) in 1/s. The real part is stiffness, the imaginary one
    friction.
    """

    amplitude_m: Array
    omega: Array
    N: Complex

    def force(self) -> "scipy.interpolate.RegularGridInterpolator":
        """`A N` in N over (log A, log omega), linear between grid points: of similar size where N spans decades."""
        grid = (np.log(self.amplitude_m), np.log(self.omega))
        return scipy.interpolate.RegularGridInterpolator(
            grid, self.amplitude_m[:, None] * self.N, bounds_error=False, fill_value=None
        )


@dataclass(frozen=True)
class Balance:
    """A cycle `x = A sin` of the harmonic balance; `stable`: it returns after a small disturbance."""

    amplitude_m: float
    frequency_Hz: float
    stable: bool


def describe(
    model: ControlModel, amplitude_m: Array = AMPLITUDES_M, frequency_Hz: Array = FREQUENCIES_HZ
) -> Describing:
    """The describing function of `model`'s surface, and of effects that a pull feels too, by simulation with set-valued
    friction; on a plate in closed form: `A N = j 4 mu m g/pi`.
    """
    omega = 2 * math.pi * np.asarray(frequency_Hz, dtype=np.float64)
    surface, known = surface_of(model.rig), model.theta
    if not surface.dragged:
        force, _ = surface.hold(0.0, known.base, model.drive.carried_kg)
        return Describing(amplitude_m, omega, np.outer(1j * 4 * force / (math.pi * amplitude_m), np.ones_like(omega)))
    pulled = assemble(surface, Pull(), tuple(e for e in model.symbols.effects if Pull.name in e.kinds))
    kernel, p = Kernel(pulled.step, pulled.correct), pulled.vector(known)
    N = np.zeros((len(amplitude_m), len(omega)), dtype=np.complex128)
    for j, w in enumerate(omega):
        period = 2 * math.pi / w
        n = max(_STEPS, math.ceil(period / _LONGEST_STEP_S))
        phase = 2 * math.pi / n * np.arange((_SETTLE + _MEASURE) * n + 1)
        for i, A in enumerate(amplitude_m):
            pull = np.zeros(phase.size)
            kernel.one(pulled.start(), A * np.sin(phase), pull, 0.0, p, 1, period / n, pull)
            last = slice(_SETTLE * n + 1, None)
            N[i, j] = 2j / (_MEASURE * n * A) * np.dot(pull[last], np.exp(-1j * phase[last]))
    return Describing(np.asarray(amplitude_m, dtype=np.float64), omega, N)


def without_wall(model: ControlModel) -> Linear:
    """The linear plant about rest without the wall, mass and drive alone: the wall's counterpart."""
    known, mass = model.theta, surface_of(model.rig).body_kg
    symbols = assembled(Plate(mass, 0.0), model.drive, model.symbols.effects, model.smoothing)
    values = [0.0 if p.key == "friction_coefficient" else known[p.key] for p in symbols.parameters]
    return linearise(replace(model, symbols=symbols, values=np.array(values)), "slip", 0.0)


def compliance(plant: Linear, law: Pid | Gains, omega: Array, delay_s: float) -> Complex:
    """`G(j omega)` in m/N, (k,): motion of the capsule per force under `law`, measurements `delay_s` late."""
    z = np.exp(1j * omega * plant.tick_s)
    late = np.exp(-1j * omega * delay_s)
    n = len(plant.states)
    pushed = np.linalg.solve(z[:, None, None] * np.eye(n) - plant.A, np.broadcast_to(plant.E, (len(z), n, 1)))[..., 0].T
    C, led = feedback(plant, law, z), plant.response(z)
    command = -late * np.sum(C * pushed, axis=0) / (1 + late * np.sum(C * led, axis=0))
    return np.asarray(pushed[0] + led[0] * command)


def balances(wall: Describing, plant: Linear, law: Pid | Gains, delay_s: float) -> list[Balance]:
    """All (A, omega) within the grid of `wall` at which `F = 1 + N(A, omega) G(j omega) = 0`, smallest first; `plant`
    is the one without wall. First harmonic only: it neglects what G passes at 3 omega. With s = sigma + j omega, F = 0
    along a disturbance dA gives sigma = omega Im(F_A/F_w) dA; a cycle is stable if that is below 0.
    """
    force = wall.force()

    def F(at: Array) -> Complex:
        """(k,) at the points `at` (k, 2) of (log A, log omega)."""
        return np.asarray(1 + force(at) / np.exp(at[:, 0]) * compliance(plant, law, np.exp(at[:, 1]), delay_s))

    def settles(at: Array) -> bool:
        left, right, below, above = F(at + _APART * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]))
        return bool(((left - right) / (below - above)).imag < 0)

    a, w = (
        np.linspace(np.log(axis[0]), np.log(axis[-1]), _FINE * len(axis)) for axis in (wall.amplitude_m, wall.omega)
    )
    size = np.array([a[1] - a[0], w[1] - w[0]])
    values = F(np.stack(np.meshgrid(a, w, indexing="ij"), axis=-1).reshape(-1, 2)).reshape(len(a), len(w))
    found: list[Array] = []
    for i, j in np.argwhere(_mixed(values.real) & _mixed(values.imag)):
        middle = np.array([a[i], w[j]]) + 0.5 * size
        answer = scipy.optimize.root(lambda at: F(at[None, :]).view(np.float64), middle)
        new = all(np.any(np.abs(one - answer.x) > 0.5 * size) for one in found)
        if answer.success and new and np.all(np.abs(answer.x - middle) < size):
            found.append(answer.x)
    cycles = [Balance(math.exp(at[0]), math.exp(at[1]) / (2 * math.pi), settles(at)) for at in found]
    return sorted(cycles, key=lambda one: one.amplitude_m)


def _mixed(values: Array) -> NDArray[np.bool_]:
    """Cells (a - 1, w - 1) at whose corners the sign of `values` (a, w) differs."""
    corners = np.stack([values[:-1, :-1], values[1:, :-1], values[:-1, 1:], values[1:, 1:]])
    return np.asarray((corners.min(axis=0) <= 0) & (corners.max(axis=0) >= 0))
