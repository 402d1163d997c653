"""A loop's frequency response with delay: margins, sensitivity peak, bandwidth, closed-loop poles."""

import math
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from controller.model.linear import Linear
from controller.signals import Array

Complex = NDArray[np.complex128]
_POINTS = 4000  # frequencies up to half the sampling rate


@dataclass(frozen=True)
class Margins:
    """`gain` (factor), `phase_deg`, `delay_s` beyond the present one, `sensitivity_peak` max |1/(1 + L)|,
    `crossover_Hz` of |L| = 1, `bandwidth_Hz` at which the closed loop has fallen by 3 dB, `stable` by the poles. Inf or
    NaN without such a crossing.
    """

    gain: float
    phase_deg: float
    delay_s: float
    sensitivity_peak: float
    crossover_Hz: float
    bandwidth_Hz: float
    stable: bool


@dataclass(frozen=True)
class OpenLoop:
    """An open loop `L` (discrete, broken at the plant's command), poles (k,) of the closed one, with `delay_s`."""

    name: str
    phase: str
    tick_s: float
    delay_s: float
    omega: Array
    L: Complex
    poles: Complex

    def margins(self) -> Margins:
        frd = control.frd(self.L, self.omega, smooth=True)
        gain, phase, least, _, crossover, _ = control.stability_margins(frd)
        T = np.abs(self.L / (1 + self.L))
        fallen = np.flatnonzero(T[0] / math.sqrt(2) > T)
        band = self.omega[fallen[0]] / (2 * math.pi) if fallen.size else math.nan
        delay = math.radians(float(phase)) / float(crossover) if np.isfinite(phase) and crossover > 0 else math.inf
        peak = 1 / float(least) if least and np.isfinite(least) else 1.0
        return Margins(
            float(gain), float(phase), delay, peak, float(crossover) / (2 * math.pi), float(band), self.stable()
        )

    def stable(self) -> bool:
        """Whether all poles are inside the unit circle."""
        return bool(np.all(np.abs(self.poles) < 1))

    def sensitivity(self) -> Array:
        """`|1/(1 + L)|` over `omega`."""
        return np.asarray(np.abs(1 / (1 + self.L)))


def closed_loop(name: str, plant: Linear, open_loop: control.StateSpace, delay_s: float) -> OpenLoop:
    """Frequency response with the exact delay; poles with the delay in whole ticks, rounded up."""
    h = plant.tick_s
    omega = np.geomspace(0.02, 0.999 * math.pi / h, _POINTS)
    L = np.asarray(open_loop(np.exp(1j * omega * h))).ravel() * np.exp(-1j * omega * delay_s)
    late = math.ceil(delay_s / h - 1e-9)
    whole = open_loop if late == 0 else control.series(open_loop, _held_back(late, h))
    closed = whole.A - whole.B @ whole.C / (1 + float(np.squeeze(whole.D)))
    return OpenLoop(name, plant.phase, h, delay_s, omega, L, np.linalg.eigvals(closed).astype(complex))


def _held_back(ticks: int, h: float) -> control.StateSpace:
    """A delay of whole ticks."""
    A, C = np.eye(ticks, k=-1), np.zeros((1, ticks))
    C[0, -1] = 1.0
    return control.ss(A, np.eye(ticks, 1), C, 0.0, h)
