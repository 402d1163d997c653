"""Time series of a capsule in the gut: pull and magnetic rigs (coil and vibro the same way), predicted by the assembled model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from models.assembly import Assembly, assemble_gut
from models.drives.drive import Drive
from models.effects import BY_ID, effects_for
from models.effects.effect import Effect
from models.identification.lower import Kernel, lower
from models.parameter import Parameter
from models.record import Record
from models.wall import Wall, base_parameters

Array = NDArray[np.float64]
Theta = Mapping[str, float]

LOW_PASS_HZ = 2.0
_TAIL = 8.0  # standard deviations beyond which a difference counts ever less: samples at a jump of the speed
_STEP = 5e-4  # s, internal step of a free capsule


def low_passed(signal: Array, dt: float) -> Array:
    """`signal` without what is faster than 2 Hz: Butterworth, second order, forward and back, so without phase."""
    if len(signal) < 16 or LOW_PASS_HZ * 2 * dt >= 1:
        return signal
    return np.asarray(sosfiltfilt(butter(2, LOW_PASS_HZ * 2 * dt, output="sos"), signal))


@cache
def _model(wall: Wall, drive: Drive, names: tuple[str, ...]) -> tuple[Assembly, Kernel]:
    assembly = assemble_gut(wall, drive, [BY_ID[name] for name in names])
    return assembly, lower(assembly.step, assembly.correct)


def active_effects(theta: Theta) -> tuple[str, ...]:
    """Ids of the effects that have an entry in `theta`, sorted."""
    return tuple(sorted({name.split(".")[0] for name in theta if "." in name}))


@dataclass(frozen=True)
class GutKind:
    """A `pull` or `magnetic` rig. `noise_std` of the sensor; `memories` in s are the observer's time constants of the fit's stages."""

    name: str
    wall: Wall
    drive: Drive
    noise_std: float
    memories: tuple[float, ...]
    base: tuple[Parameter, ...] = ()
    effects: tuple[type[Effect], ...] = ()
    stages: int = 3
    measure: str = "rms of the free-running prediction, low-passed at 2 Hz"
    unit: str = "N"
    quantity: str = field(default="force_N")

    @classmethod
    def build(cls, wall: Wall, drive: Drive, noise_std: float) -> GutKind:
        """The kind for a wall and a drive."""
        memories = (0.03, 0.2) if drive.imposed else (0.2, 1.0)
        return cls(
            drive.name,
            wall,
            drive,
            noise_std,
            memories,
            base_parameters(wall.tissue) + drive.parameters(),
            effects_for(drive.name),
            unit="N" if drive.imposed else "m",
            quantity=drive.measured,
        )

    def _run(self, record: Record, theta: Theta, memory: float | None) -> Array:
        assembly, kernel = _model(self.wall, self.drive, active_effects(theta))
        t = record["t_s"]
        dt = float(t[-1] - t[0]) / (len(t) - 1)
        command, y = record[self.drive.commanded], record[self.quantity]
        substeps = 1 if self.drive.imposed and "string_compliance" not in active_effects(theta) else max(1, round(dt / _STEP))
        state = np.array([assembly.initial[name] for name in assembly.states])
        state[0] = command[0] if self.drive.imposed else float(np.mean(y[: max(1, round(0.02 / dt))]))
        for k, name in enumerate(assembly.states):
            if name.endswith((".position_m", ".command")):
                state[k] = command[0]
        output = np.empty(len(t))
        kernel(
            state, command, y if memory else output, dt / memory if memory else 0.0, assembly.vector(theta), substeps, dt, output
        )
        delay = sum(
            float(BY_ID[e]().delay({k.split(".")[1]: v for k, v in theta.items() if k.startswith(e + ".")}))
            for e in active_effects(theta)
        )
        return np.interp(t - delay, t, output) if delay else output

    def predict(self, record: Record, theta: Theta) -> Array:
        return self._run(record, theta, None)

    def residual(self, record: Record, theta: Theta, stage: int = 0) -> Array:
        memory = self.memories[stage] if stage < len(self.memories) else None
        r = (record[self.quantity] - self._run(record, theta, memory)) / self.noise_std
        r = np.where(np.isfinite(r), r, 1e6)
        return np.sign(r) * _TAIL * np.sqrt(2 * (np.sqrt(1 + (r / _TAIL) ** 2) - 1))

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        parts = []
        for record, predicted in zip(records, predictions, strict=True):
            t = record["t_s"]
            parts.append(low_passed(record[self.quantity] - predicted, float(t[-1] - t[0]) / (len(t) - 1)))
        return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
