"""What the loop from residual to effect needs to know of a kind of rig."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from models.effects import Catalogue
from models.effects.effect import Effect
from models.parameter import Parameter
from models.records.record import Record
from models.theta import Theta

Array = NDArray[np.float64]
Split = tuple[list[Record], list[Record]]
"""Records to fit on, and those to judge by."""


class Kind(ABC):
    """One kind of rig with the experimenter's beliefs: free-running prediction, criterion, reported error.

    `base` holds the parameters that calibration may fit, at their nominal values; `effects` the candidates that can act
    here, as this kind has them, and `catalogue` all effects as they are declared.

    A fit goes through so many `criteria` and ends at number `final`: the last one, or the same computed more exactly.
    `judges` judge a model, block by block the one under which it fits better: an observer may lose a step that the free
    run keeps, and the free run one that the observer keeps. With `slow_view`, `residual` knows a further criterion,
    number `criteria`, that shows only what is slow in the free run.

    Below `least_gain` nothing is named: what two searches of the same criterion may differ by. `next_share` of the
    first effect's gain is what a further one must bring: small where a law can be exact, larger where a form that fits
    badly would call for others to mend it. `equivalents` are explanations that these data cannot tell from an effect
    though no fit tries them. `lanes` points are evaluated at about the price of one.
    """

    criteria: ClassVar[int] = 1
    final: ClassVar[int] = 0
    judges: ClassVar[tuple[int, ...]] = (0,)
    slow_view: ClassVar[bool] = False
    least_gain: ClassVar[float] = 0.05
    next_share: ClassVar[float] = 0.05
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
        """Lengths in s of ever longer beginnings of a record, the first with a few slip events; none for tables."""
        return ()

    @property
    @abstractmethod
    def quantity(self) -> str:
        """The measured column; several are listed in words."""

    @property
    def quantities(self) -> tuple[str, ...]:
        """Each measured column."""
        return (self.quantity,)

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
        """What `error` is, in words."""

    @property
    def free_run(self) -> int:
        """The criterion on which models are fitted and compared: the free run, or a kind's only one."""
        return self.criteria - 1

    def nominal(self) -> Theta:
        """The base parameters as believed."""
        return Theta.declared(self.base)

    @abstractmethod
    def predict(self, record: Record, theta: Theta) -> Array:
        """The measured column as the model predicts it from the driven column alone; shape of the measured column."""

    @abstractmethod
    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        """What a fit minimises: differences in units of their standard deviation, fixed length for a record, about unit
        variance and independent of each other where the model is right. `criterion` counts up to `criteria` - 1, from a
        criterion that is smooth but forgets (an observer keeps the model in step) to the one that is meant; most kinds
        have one criterion.
        """

    def residuals(self, record: Record, thetas: Sequence[Theta], criterion: int = 0) -> list[Array]:
        """`residual` at several points."""
        return [self.residual(record, theta, criterion) for theta in thetas]

    @abstractmethod
    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """The error measure that is reported (`measure` says in words which), pooled over the records."""

    @abstractmethod
    def noise_floor(self, records: Sequence[Record]) -> float:
        """What a perfect model would leave of `error`: the noise (repeats' scatter) through the same measure."""

    @abstractmethod
    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """A record like `record` measured on the model at `theta` with the noise believed: what chance looks like."""

    def measured(self, record: Record) -> Array:
        """The measured column, or columns, (n,) or (n, m)."""
        return record[self.quantity]

    @abstractmethod
    def signals(self, record: Record) -> dict[str, Array]:
        """What the residual may depend on, by name."""

    @abstractmethod
    def columns(self, record: Record, predicted: Array) -> dict[str, Array]:
        """A prediction as the columns of a file."""

    def extra_force(self, record: Record, theta: Theta) -> tuple[Array, Array] | None:
        """What the model at `theta` leaves of `record` as a force along +x that acts beyond it, and the force that
        moves the body, both (n,) in N (torques in N m); None where the residual is not one.
        """
        return None

    def searched(self, records: Sequence[Record]) -> list[Record]:
        """What of `records` a search looks at: all, or their beginnings where a short run tells as much."""
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
