"""A control model as the world of a closed loop: sharp friction, and a localisation with noise, rate and lateness."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from controller.model.control_model import ControlModel
from controller.signals import Array, Measurement
from models.theta import bare

CURRENT: Final = "coil_current_A"


@dataclass(frozen=True)
class Localisation:
    """Readings at `rate_Hz` with noise of `std_m`, in steps of `quantum_m` (0: none), that come `latency_s` late."""

    rate_Hz: float = 100.0
    std_m: float = 0.5e-3
    latency_s: float = 8e-3
    quantum_m: float = 0.0


@dataclass(frozen=True)
class Push:
    """A random force along +x that a model lacks: Gaussian, of `force_N` rms, with the correlation time `time_s`."""

    force_N: float = 0.0
    time_s: float = 1.0


Possible = tuple[ControlModel, Push]
"""A model that may be right, and what it lacks."""


class ModelWorld:
    """The capsule as the `world` has it, from rest at `place_m` under `command` at `begin_s`. A carriage reports its
    place, a coil driven by voltage its current. `state` is the true one; no controller may see it or the push.
    """

    def __init__(
        self, world: Possible, seen: Localisation, seed: int, begin_s: float, place_m: float, command: float
    ) -> None:
        self.model = sharp = world[0].sharp
        self._pushing, self._luck = world[1], np.random.default_rng([seed, 1])
        self._push_N = self._pushing.force_N * self._luck.standard_normal(1)
        self._keep = math.exp(-sharp.tick_s / self._pushing.time_s)
        self._kernels, self._gap_m = sharp.kernels, sharp.drive.gap_limit_m if sharp.drive.anchored else None
        self._place = None if sharp.placed else sharp.measured
        self._states = np.ascontiguousarray(sharp.initial(place_m, command)[None, :])
        self._command, self._seen, self._begin_s = command, seen, begin_s
        self._rng, self._samples = np.random.default_rng(seed), 0
        self._past = deque([self.state.copy()], maxlen=round(sharp.delay_s / sharp.tick_s) + 1)
        self._waiting: list[tuple[float, Measurement]] = []
        self._current = next((k for k, name in enumerate(sharp.states) if bare(name) == "current_A"), None)

    @property
    def state(self) -> Array:
        return np.asarray(self._states[0])

    def advance(self, command: float, until_s: float) -> list[Measurement]:
        """Advance by a tick to `until_s` with the drive at `command` there; the measurements that arrived."""
        model, kernels = self.model, self._kernels
        before = model.command_from(self._command, command)
        start = until_s - model.tick_s
        kernels.run(
            self._states, before, command, self._push_N, start, model.tick_s, kernels.substeps, kernels.parameters
        )
        fresh = self._pushing.force_N * math.sqrt(1 - self._keep**2)
        self._push_N = self._keep * self._push_N + fresh * self._luck.standard_normal(1)
        self._command = command
        self._past.append(self.state.copy())
        seen, drive = self._seen, self._drive(until_s)
        if until_s - self._begin_s >= self._samples / seen.rate_Hz - 1e-9:
            self._samples += 1
            past = self._past[0]
            shown = float(past[0] if self._place is None else self._place(past, until_s))
            value = shown + seen.std_m * self._rng.standard_normal()
            value = round(value / seen.quantum_m) * seen.quantum_m if seen.quantum_m > 0 else value
            self._waiting.append((until_s + seen.latency_s, Measurement("position_m", value, until_s)))
        arrived = [m for due, m in self._waiting if due <= until_s + 1e-9]
        self._waiting = self._waiting[len(arrived) :]
        return arrived + drive

    def _drive(self, now: float) -> list[Measurement]:
        """What the drive reports."""
        drive = self.model.drive
        if drive.anchored:
            return [Measurement(drive.commanded, self._command, now)]
        return [] if self._current is None else [Measurement(CURRENT, float(self.state[self._current]), now)]

    def broken(self, speed_m_s: float) -> bool:
        """Whether the true state breaks a hard limit: the speed, or the gap of a magnet's greatest pull."""
        x, v = float(self.state[0]), float(self.state[1])
        if not math.isfinite(x + v) or abs(v) > speed_m_s:
            return True
        return self._gap_m is not None and abs(self._command - x) > self._gap_m
