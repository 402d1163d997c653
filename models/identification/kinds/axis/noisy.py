"""An axis whose place is too noisy for its acceleration: fitted to the place, which runs from the measured force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from models.identification.kind import Array, Split
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.axis.driven import DrivenAxisKind
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.rig import Rig
from models.theta import Theta


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
