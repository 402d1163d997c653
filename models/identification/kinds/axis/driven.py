"""An axis whose place runs from the force alone, with stick and slip, because that is driven or the place is noisy."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from math import inf
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from models.checks.usable import counted
from models.drives.axis_force import AxisForce, AxisTorque, by
from models.effects import Catalogue
from models.effects.effect import Effect
from models.identification.fitting.fitter import Fitter
from models.identification.kind import Array, Split
from models.identification.kinds.axis.axis import AxisKind, base_of, coordinates_for, size_of, splits_of, stated_noise
from models.identification.kinds.axis.coordinates import LINE, Coordinates
from models.identification.kinds.axis.effects import Size, candidates
from models.identification.kinds.axis.moved import band_of
from models.identification.kinds.axis.zero_phase import motion
from models.identification.kinds.series.drive_input import evenly, interval
from models.identification.kinds.series.series import SeriesKind, noise_beside, resolution, series_noise
from models.identification.kinds.series.simulation import LAUNCH, launch
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.benches import AXIS
from models.rigs.rig import Rig
from models.theta import Theta


@dataclass(frozen=True)
class DrivenAxisKind(SeriesKind):
    """The same model as `AxisKind`, with its parameters and effects, run from the force: it starts where and as fast as
    a record does by its first samples. Effects are sought under an observer, for errors of a free run grow; the last
    fit is one to the free run where that follows the record.
    """

    coordinates: Coordinates = LINE
    force_scale_std: float = SET.axis_scale
    follows: bool = True
    measure: str = "rms error of the free-running prediction"
    judges: ClassVar[tuple[int, ...]] = (0,)
    next_share: ClassVar[float] = SET.axis_next
    least_gain: ClassVar[float] = SET.least_gain
    tail: ClassVar[float] = inf

    @classmethod
    def from_rig(cls, rig: Rig, records: Sequence[Record], holds: bool = True) -> DrivenAxisKind:
        """The axis that a rig file describes; what it leaves out starts at the size of the `records`."""
        c, catalogue = coordinates_for(rig, records), Catalogue.of(rig)
        std, made = stated_noise(rig, c)[1], AxisTorque if c.turns else AxisForce
        logged = (n for n in (c.force, *AXIS.may_drive) if records and all(n in r.columns for r in records))
        driven = next(logged, "" if records else rig.driven)
        free = rig.axis.constant(driven) is None  # it is then a parameter
        measured = driven == c.force and not rig.driven  # a sample of which is no command that holds
        drive = (by(made, driven) if free else made)(holds=holds and not measured)
        c = replace(c, force=drive.commanded)
        loads = noise_beside(records, rig.noise)
        known = [r for r in records if {c.force, c.position} <= r.columns.keys()]
        if not known:
            effects, base = _running(c, None, catalogue), (*drive.rail.parameters(), *drive.parameters())
            catalogue = replace(catalogue, variants=effects)
            own = cls(drive.rail, drive, 1.0, base, effects, catalogue=catalogue, coordinates=c)
            return replace(own, beside=MappingProxyType(loads))
        size = size_of(c, known, min(band_of(r["t_s"], r[c.position], std) for r in known))
        scale = SET.axis_scale if rig.noise.force_scale_std is None else rig.noise.force_scale_std
        base = base_of(rig, c, size)
        if free or not any(r[c.force].any() for r in known):
            # a free swing, or a current, shows ratios to the inertia, which is as stated, else 1
            inertia, scale = getattr(rig.axis, c.base[0]) or 1.0, 0.0
            size = replace(size, force=size.acceleration * inertia, command=size.force if free else 0.0)
            per = size.force / (size.command or size.force)
            ratio = tuple(replace(p, value=per, lower=1e-3 * per, upper=1e3 * per) for p in drive.parameters())
            base = (replace(base[0], value=inertia, fit=False), *base_of(rig, c, size)[1:], *ratio)
        effects, step = _running(c, size, catalogue), resolution(known, c.position)
        least = max(SET.axis_finest * (size.high - size.low), step / np.sqrt(12))
        noise = max(series_noise(known, c.position, std), least)
        averaged = max(1, round(SET.axis_mean_s / interval(known[0])))
        catalogue = replace(catalogue, variants=effects)
        kind = cls(drive.rail, drive, noise, base, effects, averaged, step, catalogue=catalogue, coordinates=c)
        kind = replace(kind, beside=MappingProxyType({name: max(std, least) for name, std in loads.items()}))
        near = Fitter.of(kind, known, []).near(kind.nominal()).theta
        off = kind.error(known, [kind.predict(r, near) for r in known])
        moved = np.std(np.concatenate([r[c.position] for r in known]))
        return replace(kind, follows=bool(off < SET.axis_follows * moved), force_scale_std=scale)

    @property
    def unit(self) -> str:
        return self.coordinates.length_unit

    @property
    def memory(self) -> float:
        return self.drive.remembers_s

    @property
    def beginnings_s(self) -> tuple[float, ...]:
        return ()

    @property
    def free_run(self) -> int:
        return 0

    @property
    def final(self) -> int:
        return int(self.follows)

    def scale_std(self, p: Parameter) -> float:
        """All that is as large as the force is: what is in N, or in kg, which is N s2/m."""
        return self.force_scale_std if {"N", "kg"} & set(re.split("[ /]", p.unit)) else 0.0

    def driven(self, record: Record) -> Record:
        bare, start = super().driven(record), launch(record, self.drive.measured)
        return bare.with_columns({name: np.full(len(record), at) for name, at in zip(LAUNCH, start, strict=True)})

    def _from_the_start(self, record: Record, outputs: Array) -> Array:
        return outputs

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """Rms of the prediction error over the samples that count; of the load's place, about its mean."""
        if self.column in self.beside:
            return super().error(records, predictions)
        off = [(r[self.quantity] - p)[counted(r)] for r, p in zip(records, predictions, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))

    def splits(self, records: Sequence[Record]) -> list[Split]:
        return splits_of(records, self.coordinates.position)

    def signals(self, record: Record) -> dict[str, Array]:
        c = self.coordinates
        even = evenly(record, (c.position, c.force))
        m = motion(even["t_s"], even[c.position])
        x, v, a = (np.interp(record["t_s"], even["t_s"], one) for one in (m.x, m.v, m.a))
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(x)))])
        found = {
            "t_s": record["t_s"],
            **dict(zip(c.names[:3], (x, v, a), strict=True)),
            f"travelled_{c.length_unit}": path,
        }
        return found | ({c.force: record[c.force]} if record[c.force].any() else {})


def _running(c: Coordinates, size: Size | None, catalogue: Catalogue) -> tuple[type[Effect], ...]:
    """The effects that a run has: all but those of logged inputs, and of friction with memory, where nothing sticks."""
    known = candidates(c, size, catalogue, driven=True)
    return tuple(e for e in known if not (e.loaded() or e.answers("direction")))


@dataclass(frozen=True)
class NoisyAxisKind(AxisKind):
    """Noise of the place in the acceleration draws the inertia down, and all that goes with it: parameters are fitted
    to the place, which is `run` from the measured force under an observer.
    """

    run: DrivenAxisKind = field(kw_only=True)

    @classmethod
    def where_shaken(cls, kind: AxisKind, rig: Rig, records: Sequence[Record]) -> AxisKind:
        """`kind` itself, unless the place is too noisy for a fit to the force; its error is then told in half the band,
        where the force that it computes from this place has less of that noise.
        """
        known = [record for record in records if kind.quantity in record.columns]
        if not known or not any(map(kind.shaken, known)):
            return kind
        own = {one.name: getattr(kind, one.name) for one in fields(kind) if not one.name.startswith("_")}
        return cls(**{**own, "band": kind.band / 2}, run=DrivenAxisKind.from_rig(rig, known, holds=False))

    @property
    def _running(self) -> DrivenAxisKind:
        """`run`, with the effects from outside that this kind has."""
        return replace(self.run, catalogue=replace(self.catalogue, variants=self.run.effects))

    def stacked(self, record: Record, thetas: Sequence[Theta], criterion: int = 0) -> Array:
        return self._running.stacked(record, thetas)

    def scale_std(self, p: Parameter) -> float:
        return self.run.scale_std(p)

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """The same force with the place that it gives."""
        return self._running.imitate(record, theta, rng)

    def splits(self, records: Sequence[Record]) -> list[Split]:
        return self.run.splits(records)
