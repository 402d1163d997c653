"""What identification needs to know of a kind of rig."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from models.effects import Catalogue
from models.effects.effect import Effect
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.theta import Theta

Array = NDArray[np.float64]
Split = tuple[list[Record], list[Record]]
"""Training records and validation records."""


class Kind(ABC):
    """One kind of rig with the experimenter's beliefs: free-running prediction, criterion, reported error.

    `base` holds the parameters that calibration may fit, at their nominal values; `effects` the candidates that can act
    here, as this kind has them; `catalogue` all effects as they are declared.

    A fit goes through `criteria` criteria and ends at number `final`: the last one, or the same computed more exactly.
    `judges` are the criteria that validate a model; of each block the better one counts, because the observer may lose
    a slip event that the free run keeps, and the reverse.

    Below `least_gain`, by which two searches of the same criterion may differ, nothing is named. A further effect must
    gain `next_share` of the first one's gain: little where a law can be exact, more where a bad form would need other
    effects to repair it. `equivalents` are explanations that these data do not separate from an effect though no fit
    tries them. `lanes` points are evaluated at about the price of one.
    """

    criteria: ClassVar[int] = 1
    judges: ClassVar[tuple[int, ...]] = (0,)
    least_gain: ClassVar[float] = SET.least_gain
    next_share: ClassVar[float] = SET.next_share
    lanes: ClassVar[int] = 1
    base: tuple[Parameter, ...]
    effects: tuple[type[Effect], ...]
    catalogue: Catalogue
    equivalents: Mapping[str, tuple[str, ...]] = MappingProxyType({})

    @property
    @abstractmethod
    def name(self) -> str:
        """Its name in a rig file."""

    @property
    def beginnings_s(self) -> tuple[float, ...]:
        """Lengths in s of growing prefixes of a record, the first with a few slip events; none for tables."""
        return ()

    @property
    @abstractmethod
    def quantity(self) -> str:
        """The measured column; several are listed in words."""

    @property
    def quantities(self) -> tuple[str, ...]:
        """Each measured column."""
        return self.channels

    @property
    def channels(self) -> tuple[str, ...]:
        """The measured columns with a noise, an error and checks of their own."""
        return (self.quantity,)

    def alone(self, column: str) -> Self:
        """This kind with the one of its `channels` alone."""
        return self

    @property
    @abstractmethod
    def unit(self) -> str:
        """Its unit."""

    @property
    def error_unit(self) -> str:
        """The unit of `error`, per cent where it is relative; empty for a pure number."""
        return self.unit.removeprefix("1")

    @property
    @abstractmethod
    def measure(self) -> str:
        """What `error` is, in words, for the report."""

    @property
    def free_run(self) -> int:
        """The criterion by which models are fitted and compared: the free run, or a kind's only one."""
        return self.criteria - 1

    @property
    def final(self) -> int:
        """The criterion of the last fit: the first, the free run, or that computed more exactly."""
        return 0

    def scale_std(self, p: Parameter) -> float:
        """Relative standard deviation that `p` has from a scale which no record shows."""
        return 0.0

    def nominal(self) -> Theta:
        """The base parameters as believed."""
        return Theta.declared(self.base)

    @abstractmethod
    def predict(self, record: Record, theta: Theta) -> Array:
        """The measured column as the model predicts it from the driven column alone; shape of the measured column."""

    def driven(self, record: Record) -> Record:
        """`record` with what drives it alone, from which a prediction is made."""
        return record.driven

    def predictions(self, record: Record, thetas: Sequence[Theta]) -> list[Array]:
        """`predict` at several points."""
        return [self.predict(record, theta) for theta in thetas]

    @abstractmethod
    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        """What a fit minimises: differences in units of their standard deviation, of fixed length for a record, about
        white with unit variance where the model is right. `criterion` goes from 0, which is smooth because an observer
        corrects the model, to `criteria` - 1, the free run; most kinds have one criterion.
        """

    def stacked(self, record: Record, thetas: Sequence[Theta], criterion: int = 0) -> Array:
        """`residual` at several points, as rows one after the other in memory."""
        return np.array([self.residual(record, theta, criterion) for theta in thetas])

    @abstractmethod
    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """The error measure that is reported (`measure` says in words which), pooled over the records."""

    @abstractmethod
    def noise_floor(self, records: Sequence[Record]) -> float:
        """The `error` of a perfect model: the noise (the scatter of repeats) in the same measure."""

    def made(self, record: Record, theta: Theta) -> Record:
        """`record` with what the model at `theta` predicts as measured."""
        return record.with_columns({c: self.alone(c).predict(record, theta) for c in self.channels})

    @abstractmethod
    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """A record like `record`, simulated by the model at `theta` with the believed noise."""

    def measured(self, record: Record) -> Array:
        """The measured column, or columns, (n,) or (n, m)."""
        return record[self.quantity]

    @abstractmethod
    def signals(self, record: Record) -> dict[str, Array]:
        """What the residual may depend on, by name."""

    def columns(self, record: Record, predicted: Array) -> dict[str, Array]:
        """A prediction as the columns of a file: of a time series at its times."""
        return {"t_s": record["t_s"], self.quantity: predicted}

    def extra_force(self, record: Record, theta: Theta) -> tuple[Array, Array] | None:
        """The residual of `record` at `theta` as an extra force along +x, and the force that moves the body, both (n,)
        in N (torques in N m); None where the residual is no force.
        """
        return None

    def slow(self, records: Sequence[Record], rows: Array) -> Array:
        """What is slow in residuals `rows` (k, m) of `records`; all of them where no row is in time."""
        return rows

    def searched(self, records: Sequence[Record]) -> list[Record]:
        """The part of `records` that a search uses: all, or prefixes where a short run shows as much."""
        return list(records)

    @abstractmethod
    def splits(self, records: Sequence[Record]) -> list[Split]:
        """Splits into (training, validation) parts: by record, condition or sample; never within one."""

    def declared(self, effect: str) -> type[Effect]:
        """The `effect` with this kind's own ranges and names of parameters; else the catalogue's."""
        return next((own for own in self.effects if own.id == effect), self.catalogue[effect])

    @property
    def in_base(self) -> frozenset[str]:
        """Ids of the effects that belong to the base."""
        return frozenset(p.effect for p in self.base if p.effect)


def present(effects: Sequence[type[Effect]], theta: Theta) -> list[tuple[Effect, dict[str, float]]]:
    """The effects in `theta`, each with its parameters, at their defaults where left out."""
    given = [(effect, theta.effects[effect.id]) for effect in effects if theta.effects.get(effect.id)]
    return [(effect(), {p.name: own.get(p.name, p.value) for p in effect.parameters()}) for effect, own in given]
