"""The control model of a vibro rig over many cycles of a waveform: speed, energy, travel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import casadi as ca
import numpy as np

from controller.drives import INNER_MASS
from controller.signals import Array
from controller.vibro.waveform import Waveform
from models.assembly.model import Assembly, assemble
from models.compiled.kernel import Kernel
from models.drives.coil import Winding
from models.drives.vibro import Vibro, unloaded
from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect
from models.parameter import Name, nearest
from models.rigs.kinds import drive_of, surface_of
from models.rigs.rig import Rig
from models.surfaces.surface import Surface
from models.theta import Theta, spelled

STEP_S = 6e-5  # longest step of a cycle's integration
SETTLE_S, MEASURE_S = 0.6, 0.6  # s before and during the measurement of a gait
COPPER_N2_PER_W = 0.5**2 / Winding.resistance_ohm
"""Square of the coil's motor constant, `k^2/R` in N^2/W: 0.5 N/A and 10 ohm like the project's other coils."""
_ELSEWHERE = ("body_mass_kg", "inner_mass_kg", "mirror")


@dataclass(frozen=True)
class Gait:
    """The steady effect of a waveform: mean `speed_m_s` and the body's highest `peak_m_s`, the coil's heat `copper_W =
    F^2 R/k^2`, its mechanical `work_W`, and the swing of the inner mass to the `front_m` and `rear_m` of its rest.
    """

    speed_m_s: float
    copper_W: float
    work_W: float
    front_m: float
    rear_m: float
    peak_m_s: float

    @property
    def energy_J_per_m(self) -> float:
        """Electrical energy per distance, J/m = mJ/mm; infinite at rest."""
        return (self.copper_W + self.work_W) / abs(self.speed_m_s) if self.speed_m_s != 0 else math.inf


@dataclass(frozen=True)
class VibroModel:
    """Body with inner mass on `surface` under `drive` with `effects`; `values` are those of one stage of a model.
    `mirror` -1 reverses speeds, as a `vibro_table` record may.
    """

    surface: Surface
    drive: Vibro
    effects: tuple[type[Effect], ...] = ()
    values: Theta = field(default_factory=Theta)
    mirror: float = 1.0

    @classmethod
    def from_rig(cls, rig: Rig, values: Mapping[Name, float] | None = None) -> VibroModel:
        """The model of a rig file (kind `vibro` or `vibro_table`) at the `values` of a stage from `close-loop`. Raises
        ValueError for another kind of rig and for values of no effect or parameter.
        """
        if rig.drive is None or rig.kind not in INNER_MASS.models:
            kinds = " or ".join(map(repr, INNER_MASS.models))
            raise ValueError(f"rig must be of kind {kinds}; got {rig.kind!r}")
        drive = drive_of(replace(rig, kind=INNER_MASS.name))
        assert isinstance(drive, Vibro)
        return cls.of(surface_of(rig), drive, unloaded(Theta.of(values or {})), Catalogue.of(rig))

    @classmethod
    def of(cls, surface: Surface, drive: Vibro, values: Theta, known: Catalogue = CATALOGUE) -> VibroModel:
        for name in values.effects:
            if name not in known:
                raise ValueError(f"effect must be one of the catalogue; got {name!r}; {nearest(name, list(known))}")
        effects = tuple(known[name] for name in values.effects)
        own = Theta({name: value for name, value in values.base.items() if name not in _ELSEWHERE}, values.effects)
        model = cls(surface, drive, effects, own, float(values.get("mirror", 1.0)))
        keys = [spelled(p.key) for p in model.assembly().parameters]
        for name in map(spelled, own):
            if name not in keys:
                raise ValueError(f"value must be of a parameter of this rig; got {name!r}; {nearest(name, keys)}")
        return model

    @property
    def force_N(self) -> float:
        return float(self.values.get("force_N", self.drive.force_N))

    def assembly(self, smoothing: float = 0.0) -> Assembly:
        """The assembled model; `smoothing` in m/s makes it differentiable."""
        return assemble(self.surface, self.drive, self.effects, smoothing)

    def at(self, **factors: float) -> VibroModel:
        """The same with parameters of the base multiplied by `factors`, by name."""
        known = Theta.declared(self.assembly().parameters) | self.values
        return replace(self, values=self.values | Theta({name: known[name] * f for name, f in factors.items()}))


class Cycles:
    def __init__(self, model: VibroModel) -> None:
        self.model = model
        assembly = model.assembly()
        self.states = assembly.states
        self._start = assembly.start()
        self._kernel = _metered(assembly, model.drive.reaction_on_body)
        self._parameters = assembly.vector(model.values)

    def gait(self, waveform: Waveform, settle_s: float = SETTLE_S, measure_s: float = MEASURE_S) -> Gait:
        """Mean speed and powers of `waveform` over whole cycles for `measure_s`, after `settle_s` from rest."""
        levels = _sampled(waveform)
        first, last = (max(math.ceil(s / waveform.period_s), 3) for s in (settle_s, measure_s))
        state = self.rest()
        self._run(state, levels, first, waveform.period_s)
        state[-4:] = 0.0
        path = self._run(state, levels, last, waveform.period_s)
        time = last * waveform.period_s
        work, squares, front, rear = state[-4:]
        force = self.model.force_N
        copper = squares * force * force / COPPER_N2_PER_W / time
        speed = self.model.mirror * (path[-1] - path[0]) / time
        peak = np.max(np.abs(np.diff(path))) * levels.size / waveform.period_s
        return Gait(float(speed), float(copper), float(work / time), float(front), float(rear), float(peak))

    def rest(self) -> Array:
        """The model's state at rest with its meters at 0, for `step`."""
        return np.concatenate((self._start, np.zeros(4)))

    def step(self, state: Array, level: float, h: float) -> None:
        """One step of `h` in s at `level`, in place."""
        self._kernel.one(state, np.array([level]), np.zeros(1), 0.0, self._parameters, 1, h, np.zeros(1))

    def path(self, waveform: Waveform, cycles: int) -> Array:
        """Position in m of the body from rest over `cycles`, at even times, a whole number per cycle."""
        return self.model.mirror * self._run(self.rest(), _sampled(waveform), cycles, waveform.period_s)

    def last_cycle(self, waveform: Waveform, parts: int) -> Array:
        """States (parts + 1, n) at the ends of `parts` equal parts of a cycle after `SETTLE_S` from rest."""
        sub = max(math.ceil(waveform.period_s / STEP_S / parts), 4)
        levels, h = waveform.sampled(parts * sub), waveform.period_s / (parts * sub)
        state = self.rest()
        self._run(state, levels, max(math.ceil(SETTLE_S / waveform.period_s), 3), waveform.period_s)
        rows = [state[:-4].copy()]
        for k, level in enumerate(levels):
            self.step(state, float(level), h)
            if (k + 1) % sub == 0:
                rows.append(state[:-4].copy())
        return np.array(rows)

    def _run(self, state: Array, levels: Array, cycles: int, period: float) -> Array:
        """Run `cycles` from `state`, in place; the returned path starts with the state after the first step."""
        command = np.concatenate((np.tile(levels, cycles), levels[:1]))
        output = np.zeros(command.size)
        self._kernel.one(state, command, output, 0.0, self._parameters, 1, period / levels.size, output)
        return output


def _sampled(waveform: Waveform) -> Array:
    return waveform.sampled(max(math.ceil(waveform.period_s / STEP_S), 4 * len(waveform.levels)))


def _metered(assembly: Assembly, on_board: bool) -> Kernel:
    """The step with four more states: the coil's work in J, integral of the squared command, largest swings in m."""
    state, c0, c1, t, h, q = assembly.step.sx_in()
    meter = ca.SX.sym("meter", 4)
    new, _ = assembly.step(state, c0, c1, t, h, q)
    stretch, x = assembly.states.index((Vibro.name, "stretch_m")), assembly.states.index("x")
    force = q[[p.key for p in assembly.parameters].index("force_N")]
    moved = new[stretch] - state[stretch] + (0.0 if on_board else new[x] - state[x])
    after = ca.vertcat(
        meter[0] + force * c0 * moved,
        meter[1] + c0 * c0 * h,
        ca.fmax(meter[2], new[stretch]),
        ca.fmax(meter[3], -new[stretch]),
    )
    whole = ca.vertcat(state, meter)
    step = ca.Function("step", [whole, c0, c1, t, h, q], [ca.vertcat(new, after), new[x]])
    error, gain = ca.SX.sym("error"), ca.SX.sym("gain")
    return Kernel(step, ca.Function("correct", [whole, error, gain], [whole]))


Impact = Literal["none", "front", "rear", "both"]
IMPACTS: tuple[Impact, ...] = ("none", "front", "rear", "both")


def impact_of(model: VibroModel, gait: Gait) -> Impact:
    front = model.drive.front is not None and gait.front_m > model.drive.front.gap_m
    rear = model.drive.rear is not None and gait.rear_m > model.drive.rear.gap_m
    return IMPACTS[front + 2 * rear]


def in_time(rig: Rig, values: Theta) -> tuple[Rig, Theta]:
    """The `vibro` rig with the table's masses, and the values for its control model: `load_scale` multiplies force and
    friction; `mirror` is for the comparison with the record. Raises ValueError without an inner mass, or for masses not
    positive.
    """
    if rig.drive is None:
        raise ValueError(f"rig must have an inner mass for the values of a vibro_table; got a {rig.kind} rig")
    left = {name: value for name, value in unloaded(values).base.items() if name not in _ELSEWHERE}
    body = values.get("body_mass_kg", rig.capsule.mass_kg)
    inner = values.get("inner_mass_kg", rig.drive.inner_mass_kg)
    if not (body > 0 and inner > 0):
        raise ValueError(f"masses must be positive; got body_mass_kg = {body:g} and inner_mass_kg = {inner:g}")
    return replace(
        rig, capsule=replace(rig.capsule, mass_kg=body), drive=rig.drive.model_copy(update={"inner_mass_kg": inner})
    ), Theta(left, values.effects)
