"""A linear stage: the force its motion needs, `F = M a + (F_v v + F_c sgn v) level + offset - effects`, against the
measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import pairwise
from operator import mul
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from models.checks.instrument.usable import used
from models.effects import effects_for
from models.effects.effect import Effect, Signals
from models.files.record import Record
from models.files.rig import Rig
from models.identification.kind import Array, OneByOne, Theta, present
from models.identification.kinds.axis.effects import VARIANTS
from models.identification.kinds.axis.zero_phase import (
    Motion,
    decimate,
    evened,
    motion,
    passed,
    quiet_roughness,
    repeat_lag,
    sampling_rate,
)
from models.identification.kinds.conditions import may_be_left_out
from models.parameter import Parameter

NOISE, WHOLE = "_noise_N", ("_x_m", "_v_m_s", "_a_m_s2")
"""Columns that a part of a record carries on from the whole: the force's noise, and the motion filtered before the cut.
"""
_BELIEF = "rig file; without it only a start for the calibration"


@dataclass(frozen=True)
class AxisKind(OneByOne):
    """The inverse dynamics of a stage from its measured position, filtered as the EMPS authors do.

    An effect's `level` multiplies the whole friction (Coulomb and viscous), its `force` acts on the stage along +x, its
    `delay` is the time by which the position is read late. `force_std_N` is the force's noise before the filter;
    without it the repeats of the motion tell it.
    """

    base: tuple[Parameter, ...]
    force_std_N: float | None = None
    effects: tuple[type[Effect], ...] = field(default_factory=lambda: effects_for("axis", VARIANTS))
    name: str = "axis"
    criteria: int = 1
    final: int = 0
    judges: tuple[int, ...] = (0,)
    slow_view: bool = False
    lanes: ClassVar[int] = 2
    next_share: float = 0.04
    least_gain: float = 0.05
    equivalents: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    quantity: str = "force_N"
    unit: str = "N"
    measure: str = "norm of the force error over norm of the force in %, both low-passed at 40 Hz without phase"
    _noise: dict[int, tuple[Array, float]] = field(default_factory=dict, repr=False, compare=False)
    _seen: dict[tuple[int, int], tuple[Record, Motion]] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def from_rig(cls, rig: Rig) -> AxisKind:
        """The stage that a rig file describes; what it leaves out starts at 10 kg, 100 N s/m, 10 N and 0 N."""
        axis = rig.axis
        numbers = (axis.mass_kg, axis.viscous_friction_N_s_per_m, axis.coulomb_friction_N, axis.offset_N)
        return cls.around(*numbers, force_std_N=rig.noise.force_std_N)

    @classmethod
    def around(
        cls,
        mass_kg: float | None = None,
        viscous_N_s_per_m: float | None = None,
        coulomb_N: float | None = None,
        offset_N: float | None = None,
        force_std_N: float | None = None,
    ) -> AxisKind:
        """A stage with these nominal numbers, all of which a calibration may change."""

        def number(name: str, given: float | None, start: float, unit: str, lower: float, upper: float) -> Parameter:
            value = start if given is None else given
            return Parameter(name, value, unit, min(lower, value), max(upper, value), _BELIEF, fit=True)

        return cls(
            (
                number("mass_kg", mass_kg, 10.0, "kg", 1e-4, 1e3),
                number("viscous_friction_N_s_per_m", viscous_N_s_per_m, 100.0, "N s/m", 0.0, 1e4),
                number("coulomb_friction_N", coulomb_N, 10.0, "N", 0.0, 1e3),
                number("offset_N", offset_N, 0.0, "N", -1e3, 1e3),
            ),
            force_std_N,
        )

    def nominal(self) -> dict[str, float]:
        """The base parameters as believed."""
        return {p.name: p.value for p in self.base}

    def measured(self, record: Record) -> Array:
        """The measured column."""
        return record[self.quantity]

    def predict(self, record: Record, theta: Theta) -> Array:
        """Force in N that the measured motion needs, one value a row."""
        m = self._motion(record)
        if not m.even:
            even = evened(record, ("position_m",))
            return np.interp(record["t_s"], even["t_s"], self.predict(even, theta))
        s = Signals(t=m.t, x=m.x, v=m.v, direction=np.sign(m.v))
        acting = present(self.effects, theta)
        friction = theta["viscous_friction_N_s_per_m"] * m.v + theta["coulomb_friction_N"] * s.direction
        level: Any = reduce(mul, (e.level(s, p, {}) for e, p in acting), 1.0)
        extra: Any = sum(e.force(s, p, {}) for e, p in acting)
        force = theta["mass_kg"] * m.a + friction * level + theta["offset_N"] - extra
        late = sum(float(e.delay(p)) for e, p in acting)
        if late:
            force = np.interp(m.t + late, m.t, force)
        for e, p in acting:
            force = e.measured(s, p, {}, force)
        return np.asarray(force, dtype=float)

    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        """Filtered force error in units of its noise, 100 a second."""
        return self.residuals(record, [theta], criterion)[0]

    def residuals(self, record: Record, thetas: Sequence[Theta], criterion: int = 0) -> list[Array]:
        """`residual` at several points; the filter takes them together."""
        force = record[self.quantity]
        known = self._noise.get(id(force))
        if known is None or known[0] is not force:
            if len(self._noise) > 64:
                self._noise.clear()
            known = self._noise[id(force)] = (force, self.noise_std(record))
        errors = np.stack([force - self.predict(record, theta) for theta in thetas])
        errors[:, ~used(record)] = 0.0
        return list(decimate(errors, self._motion(record).rate) / known[1])

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """The authors' relative force error in %, pooled."""
        wrong = right = 0.0
        for record, prediction in zip(records, predictions, strict=True):
            rate = sampling_rate(record["t_s"])
            force = decimate(record[self.quantity], rate)
            wrong += float(np.sum((force - decimate(prediction, rate)) ** 2))
            right += float(np.sum(force**2))
        return 100 * float(np.sqrt(wrong / right))

    def noise_std(self, record: Record) -> float:
        """Standard deviation in N of the filtered force's noise: believed, else from the motion's repeats, else its
        roughness.
        """
        rate = sampling_rate(record["t_s"])
        if self.force_std_N is not None:
            return self.force_std_N * passed(rate)
        if NOISE in record.columns:
            return float(record[NOISE][0])
        force = decimate(record[self.quantity], rate)
        lag = repeat_lag(record["position_m"], rate)
        if lag is None:
            return max(quiet_roughness(force), 1e-9)
        full = decimate(record[self.quantity][lag:] - record[self.quantity][:-lag], rate)
        return max(float(np.std(full)) / math.sqrt(2), 1e-9)

    def noise_floor(self, records: Sequence[Record]) -> float:
        """What the force's noise alone, the quietest record's, makes of the error, in %."""
        forces = np.concatenate([decimate(r[self.quantity], sampling_rate(r["t_s"])) for r in records])
        return 100 * min(self.noise_std(r) for r in records) / math.sqrt(float(np.mean(forces**2)))

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """The same motion with the force of the model and noise of the same size after the filter."""
        std = self.noise_std(record)
        white = std / passed(sampling_rate(record["t_s"])) * rng.standard_normal(len(record))
        made = record.with_column(self.quantity, self.predict(record, theta) + white)
        return made.with_column(NOISE, np.full(len(record), std))

    def splits(self, records: Sequence[Record]) -> list[tuple[list[Record], list[Record]]]:
        """By record; where one holds a speed, a direction or a place that no other has, or is the only one, by four
        blocks of each record's cycle of motion, every repeat of a block left out together.
        """
        apart = [([r for r in records if r is not out], [out]) for out in records]
        if len(records) > 1 and all(may_be_left_out(out, rest) for rest, (out,) in apart):
            return apart
        each = [blocks_of_cycle(self._carrying(record)) for record in records]
        return [
            ([r for part, _ in row for r in part], [r for _, held in row for r in held])
            for row in zip(*each, strict=True)
        ]

    def _carrying(self, record: Record) -> Record:
        """`record` with its noise and its motion as columns, for parts of it."""
        m = self._motion(record)
        carried = {
            NOISE: np.full(len(record), self.noise_std(record)),
            **dict(zip(WHOLE, (m.x, m.v, m.a), strict=True)),
        }
        return replace(record, columns={**record.columns, **carried})

    def signals(self, record: Record) -> dict[str, Array]:
        """What the residual is drawn against: time, position, speed, acceleration, force."""
        m = self._motion(record)
        return {"t_s": m.t, "x_m": m.x, "v_m_s": m.v, "a_m_s2": m.a, "force_N": record[self.quantity]}

    def columns(self, record: Record, predicted: Array) -> dict[str, Array]:
        """The prediction as the columns of a file."""
        return {"t_s": record["t_s"], self.quantity: predicted}

    def _motion(self, record: Record) -> Motion:
        key = (id(record["t_s"]), id(record["position_m"]))
        known = self._seen.get(key)
        if known is not None:
            return known[1]
        if len(self._seen) > 64:
            self._seen.clear()
        if WHOLE[0] in record.columns:
            found = Motion(record["t_s"], *(record[column] for column in WHOLE))
        else:
            found = motion(record["t_s"], record["position_m"])
        self._seen[key] = (record, found)  # the record is kept so that its arrays' ids stay theirs
        return found


def blocks_of_cycle(record: Record, count: int = 4) -> list[tuple[list[Record], list[Record]]]:
    """Split a record into `count` blocks of its repeating motion (of its length where it does not repeat), each left
    out once.
    """
    rate = sampling_rate(record["t_s"])
    lag = repeat_lag(record["position_m"], rate) or len(record)
    block = (np.arange(len(record)) % lag) * count // lag
    edges = [0, *(np.flatnonzero(np.diff(block)) + 1), len(record)]
    pieces = [(int(block[a]), record.rows(slice(a, b))) for a, b in pairwise(edges) if b - a > 0.4 * rate]
    return [([p for k, p in pieces if k != out], [p for k, p in pieces if k == out]) for out in range(count)]
