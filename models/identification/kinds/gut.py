"""Time series of a capsule in the gut: pull and magnetic rigs (coil and vibro the same way), predicted by the assembled model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from models.assembly import Assembly, assemble_gut
from models.drives.drive import Drive
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.effects import BY_ID, effects_for
from models.effects.effect import Effect
from models.identification.lower import Kernel, lower
from models.parameter import Parameter
from models.record import Record
from models.rig import Rig
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
    next_share: float = 0.6
    least_gain: float = 0.4
    equivalents: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    measure: str = "rms of the free-running prediction, low-passed at 2 Hz"
    unit: str = "N"
    quantity: str = field(default="force_N")

    @classmethod
    def from_rig(cls, rig: Rig, records: Sequence[Record]) -> GutKind:
        """The kind that a rig file with a capsule, a gut and a pull or a magnet describes; the noise is estimated where not given."""
        drive: Drive = Pull()
        if rig.magnet is not None:
            drive = Magnetic(rig.magnet.magnet_stiffness_N_per_m, rig.magnet.magnet_range_m)
        elif rig.kind != "pull":
            raise ValueError(f"rig must be of kind pull or magnetic to find what its model lacks; got {rig.kind!r}")
        noise = rig.noise.force_std_N if drive.imposed else rig.noise.position_std_m
        return cls.build(Wall.around(rig.capsule, rig.tissue), drive, noise or estimated_noise(records, drive.measured))

    @classmethod
    def build(cls, wall: Wall, drive: Drive, noise_std: float) -> GutKind:
        """The kind for a wall and a drive."""
        memories = (0.03, 0.2) if drive.imposed else (0.2, 5.0)
        base = base_parameters(wall.tissue) + drive.parameters()
        unit = "N" if drive.imposed else "m"
        return cls(
            drive.name, wall, drive, noise_std, memories, base, effects_for(drive.name), unit=unit, quantity=drive.measured
        )

    def nominal(self) -> dict[str, float]:
        """The base parameters as believed."""
        return {p.name: p.value for p in self.base}

    def measured(self, record: Record) -> Array:
        """The measured column."""
        return record[self.quantity]

    def _run(self, record: Record, theta: Theta, memory: float | None, measured: Array | None) -> Array:
        assembly, kernel = _model(self.wall, self.drive, active_effects(theta))
        t = record["t_s"]
        dt = float(t[-1] - t[0]) / (len(t) - 1)
        command = record[self.drive.commanded]
        substeps = 1 if self.drive.imposed and "string_compliance" not in active_effects(theta) else max(1, round(dt / _STEP))
        state = np.array([assembly.initial[name] for name in assembly.states])
        state[0] = command[0] if self.drive.imposed or measured is None else float(np.mean(measured[: max(1, round(0.02 / dt))]))
        for k, name in enumerate(assembly.states):
            if name.endswith((".position_m", ".command")):
                state[k] = command[0]
        output = np.empty(len(t))
        kernel(
            state,
            command,
            output if measured is None or not memory else measured,
            dt / memory if memory else 0.0,
            assembly.vector(theta),
            substeps,
            dt,
            output,
        )
        delay = sum(
            float(BY_ID[e]().delay({k.split(".")[1]: v for k, v in theta.items() if k.startswith(e + ".")}))
            for e in active_effects(theta)
        )
        return np.interp(t - delay, t, output) if delay else output

    def predict(self, record: Record, theta: Theta) -> Array:
        """The free run from the driven column alone; a magnetic capsule starts at rest below its magnet."""
        return self._run(record, theta, None, None)

    def residual(self, record: Record, theta: Theta, stage: int = 0) -> Array:
        memory = self.memories[stage] if stage < len(self.memories) else None
        r = (record[self.quantity] - self._run(record, theta, memory, record[self.quantity])) / self.noise_std
        r = np.where(np.isfinite(r), r, 1e6)
        return np.asarray(np.sign(r) * _TAIL * np.sqrt(2 * (np.sqrt(1 + (r / _TAIL) ** 2) - 1)))

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        parts = []
        for record, predicted in zip(records, predictions, strict=True):
            t = record["t_s"]
            parts.append(low_passed(record[self.quantity] - predicted, float(t[-1] - t[0]) / (len(t) - 1)))
        return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))

    def noise_floor(self, records: Sequence[Record]) -> float:
        """White noise of `noise_std` through the same low-pass."""
        rng = np.random.default_rng(0)
        made = [(r, r[self.quantity] + self.noise_std * rng.standard_normal(len(r))) for r in records]
        return self.error([r for r, _ in made], [p for _, p in made])

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        return record.with_column(self.quantity, self.predict(record, theta) + self.noise_std * rng.standard_normal(len(record)))

    def folds(self, records: Sequence[Record]) -> list[tuple[list[Record], list[Record]]]:
        """The last record validates the others; a single record is cut in its middle."""
        if len(records) > 1:
            return [(list(records[:-1]), [records[-1]])]
        half = len(records[0]) // 2
        return [([records[0].rows(slice(0, half))], [records[0].rows(slice(half, None))])]

    def signals(self, record: Record) -> dict[str, Array]:
        """What the residual is drawn against."""
        t, x = record["t_s"], record[self.drive.commanded if self.drive.imposed else self.quantity]
        step = float(t[-1] - t[0]) / (len(t) - 1)
        out = {"t_s": t, "x_m": x, "v_m_s": np.gradient(low_passed(x, step), step)}
        if self.drive.imposed:
            return out | {"force_N": record[self.quantity]}
        return out | {"gap_m": record[self.drive.commanded] - x}

    def statements(self, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
        """Sentences for the report."""
        said = [f"Noise of the sensor: {self.noise_std:.3g} {self.unit}."]
        if not self.drive.imposed:
            said.append(
                "Only the ratios of hoop stress, friction and magnet stiffness show well in a position: the three may move together."
            )
        return said

    def equations(self, theta: Theta) -> list[str]:
        """The model in words and numbers."""
        p = {**self.nominal(), **theta}
        lines = [
            "m a = F_act - F_e(|v|) Sgn(v) - F_v(w) - T(u)",
            f"F_e = {p['hoop_stress_factor']:.4g} sin(theta) I1(|v|)",
            f"f_c = {p['friction_coefficient']:.4g} (m g + {p['hoop_stress_factor']:.4g} (cos(theta) I1(|v|) + I2(|v|)))",
            "stick: u' = v until |T(u)| = f_c; slip: u' = -v_i, v_i = u_c/t_r, until u = 0",
        ]
        if "magnet_stiffness_N_per_m" in p:
            lines.append(f"F_act = {p['magnet_stiffness_N_per_m']:.4g} g/(1 + (g/r)^2)^2, g = carriage - capsule")
        for name in active_effects(theta):
            values = ", ".join(f"{k.split('.')[1]} = {v:.4g}" for k, v in theta.items() if k.startswith(name + "."))
            lines.append(f"{name}: {(BY_ID[name].__doc__ or '').splitlines()[0]} ({values})")
        return lines

    def next_experiment(self, theta: Theta, records: Sequence[Record]) -> str | None:
        """What would separate the last effect from its look-alikes."""
        names = active_effects(theta)
        if not names:
            return None
        return "; ".join(f"{name} against {', '.join(BY_ID[name].look_alikes)}: {BY_ID[name].separated_by}" for name in names)

    def columns(self, record: Record, predicted: Array) -> dict[str, Array]:
        """The prediction as the columns of a file."""
        return {"t_s": record["t_s"], self.quantity: predicted}


def estimated_noise(records: Sequence[Record], column: str) -> float:
    """Standard deviation of white noise on `column`, from its second differences' median, which motion hardly touches."""
    second = np.concatenate([np.diff(record[column], 2) for record in records])
    return max(float(np.median(np.abs(second)) / 0.6745 / np.sqrt(6)), 1e-12)
