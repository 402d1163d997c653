"""A dynamic shear test: storage and loss modulus of the five-element wall over frequency, for several samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect
from models.identification.kind import Array, Kind, Split, present
from models.identification.settings import SET
from models.laws.five_elements import Moduli, angular_frequency, five_element_modulus
from models.parameter import Parameter, load_set
from models.records.record import Record
from models.rigs.benches import DMA
from models.rigs.rig import Rig
from models.theta import Theta
from models.words.sentences import listed

NAMES = ("E1", "E2", "E3", "tau1", "tau2")
COLUMNS = ("storage_modulus_Pa", "loss_modulus_Pa")


@dataclass(frozen=True)
class DmaKind(Kind):
    """Five springs and dampers in decadic logarithms: each sample has its own factor, each reading its own error."""

    base: tuple[Parameter, ...]
    modulus_std_Pa: float | None = None
    effects: tuple[type[Effect], ...] = ()
    name: str = DMA.id
    catalogue: Catalogue = CATALOGUE
    criteria: ClassVar[int] = 2
    final: ClassVar[int] = 1
    judges: ClassVar[tuple[int, ...]] = (1,)
    next_share: ClassVar[float] = SET.table_next
    quantities: tuple[str, ...] = ("storage_modulus_Pa", "loss_modulus_Pa")
    quantity: str = listed(quantities)
    unit: str = "Pa"
    error_unit: str = "%"
    measure: str = "norm of the error of the complex modulus, relative to the norm of the modulus"

    @classmethod
    def from_rig(cls, rig: Rig, records: Sequence[Record] = ()) -> DmaKind:
        """The nominal model is the five-element set of paper V, Table 3."""
        s, catalogue = load_set("zhang2014_viscoelastic_high"), Catalogue.of(rig)
        values = (s["E1"], s["E2"], s["E3"], s["eta1"] / s["E1"], s["eta2"] / s["E2"])
        spans = (("log10 Pa", 0.0, 7.5),) * 3 + (("log10 s", -5.0, 2.0),) * 2
        base = (
            Parameter(f"log10_{name}", math.log10(value), *span, source=s.source, fit=True)
            for name, value, span in zip(NAMES, values, spans, strict=True)
        )
        return cls(tuple(base), rig.noise.modulus_std_Pa, catalogue.acting_on(DMA.id), catalogue=catalogue)

    def measured(self, record: Record) -> Array:
        return np.column_stack([record[c] for c in COLUMNS])

    def predict(self, record: Record, theta: Theta) -> Array:
        """Storage and loss modulus in Pa, one row a reading."""
        frequency = record["frequency_Hz"]
        wall = five_element_modulus(angular_frequency(frequency), moduli_of(theta))
        out = np.column_stack([wall.storage, wall.loss])
        for effect, values in present(self.effects, theta):
            extra = effect.modulus(frequency, values)
            out += np.column_stack([extra.storage, extra.loss])
        return out

    def residual(self, record: Record, theta: Theta, criterion: int = 1) -> Array:
        """Errors in units of the scatter between samples: of the logarithm of the modulus (criterion 0), with which a
        fit converges from moduli that are wrong by a factor of 100, or of the modulus itself (1), all readings alike as
        in `error`. A sample's common factor is *not* whitened: with a wrong law that biases the fit (Peelle's puzzle).
        """
        measured, predicted = self.measured(record), self.predict(record, theta)
        std = math.hypot(SET.dma_sample / math.sqrt(2), SET.dma_reading)
        size = math.sqrt(float(np.mean(np.sum(measured**2, axis=1))))
        if self.modulus_std_Pa is not None:
            std = self.modulus_std_Pa / size
        if criterion == 0:
            ratio = np.log(predicted @ [1, 1j]) - np.log(measured @ [1, 1j])
            return np.column_stack([ratio.real, ratio.imag]).ravel() / std
        return (measured - predicted).ravel() / (std * size)

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """Relative error of the complex modulus in %, pooled."""
        measured = [self.measured(r) for r in records]
        wrong = sum(float(np.sum((m - p) ** 2)) for m, p in zip(measured, predictions, strict=True))
        return 100 * math.sqrt(wrong / sum(float(np.sum(m**2)) for m in measured))

    def noise_floor(self, records: Sequence[Record]) -> float:
        """The samples' scatter about their mean at each frequency, in %; for one sample as assumed."""
        frequency = np.concatenate([r["frequency_Hz"] for r in records])
        measured = np.concatenate([self.measured(r) for r in records])
        scatter, freedom = 0.0, 0
        for f in np.unique(frequency):
            same = measured[frequency == f]
            scatter += float(np.sum((same - same.mean(0)) ** 2))
            freedom += len(same) - 1
        total = float(np.sum(measured**2))
        if not freedom:
            return 100 * math.sqrt(SET.dma_sample**2 + 2 * SET.dma_reading**2)
        return 100 * math.sqrt(scatter / freedom * len(measured) / total)

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """The same frequencies measured on the model: a factor for each sample, an error for each reading."""
        made = self.predict(record, theta)
        size = np.hypot(*made.T)
        for rows in samples_of(record):
            made[rows] *= 1 + SET.dma_sample * rng.standard_normal()
            made[rows] += (self._reading(size[rows]) * size[rows])[:, None] * rng.standard_normal((len(rows), 2))
        return record.with_columns(dict(zip(COLUMNS, made.T, strict=True)))

    def splits(self, records: Sequence[Record]) -> list[Split]:
        """By sample; a single sample by frequency."""
        single = [sample for r in records for sample in single_samples(r)]
        if len(single) == 1:
            record = single[0]
            left_out = [record["frequency_Hz"] == f for f in np.unique(record["frequency_Hz"])]
            return [([record.rows(~out)] if not out.all() else [], [record.rows(out)]) for out in left_out]
        return [([s for s in single if s is not out], [out]) for out in single]

    def signals(self, record: Record) -> dict[str, Array]:
        number = np.zeros(len(record))
        for i, rows in enumerate(samples_of(record)):
            number[rows] = i + 1
        return {
            "frequency_Hz": record["frequency_Hz"],
            "sample": number,
            "modulus_Pa": np.hypot(*self.measured(record).T),
        }

    def columns(self, record: Record, predicted: Array) -> dict[str, Array]:
        return {"frequency_Hz": record["frequency_Hz"]} | dict(zip(COLUMNS, predicted.T, strict=True))

    def _reading(self, size: Array) -> Array:
        return np.full(len(size), SET.dma_reading) if self.modulus_std_Pa is None else self.modulus_std_Pa / size


def moduli_of(theta: Theta) -> Moduli:
    """The five elements in Pa and Pa s from their decadic logarithms, `eta_i = E_i tau_i`."""
    E1, E2, E3, tau1, tau2 = (10 ** theta[f"log10_{name}"] for name in NAMES)
    return Moduli(E1, E2, E3, E1 * tau1, E2 * tau2)


def samples_of(record: Record) -> list[NDArray[np.intp]]:
    """The rows of each sample in a record; all rows without a column `sample`."""
    if "sample" not in record.columns:
        return [np.arange(len(record))]
    return [np.flatnonzero(record["sample"] == s) for s in np.unique(record["sample"])]


def single_samples(record: Record) -> list[Record]:
    rows = samples_of(record)
    return [record.rows(own) for own in rows] if len(rows) > 1 else [record]
