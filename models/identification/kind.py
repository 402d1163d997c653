"""What the loop from residual to effect needs to know of a kind of rig."""

from collections.abc import Mapping, Sequence
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from models.effects import BY_ID
from models.effects.effect import Effect
from models.parameter import Parameter
from models.records.record import Record
from models.theta import Theta

Array = NDArray[np.float64]


class Kind(Protocol):
    """One kind of rig with the experimenter's beliefs: free-running prediction, criterion, reported error.

    `base` holds the parameters that calibration may fit, at their nominal values; `effects` the candidates that can act
    here.
    """

    @property
    def name(self) -> str:
        """The kind's name in a rig file."""

    @property
    def quantity(self) -> str:
        """The measured column."""

    @property
    def unit(self) -> str:
        """Its unit."""

    @property
    def measure(self) -> str:
        """What `error` is, in words."""

    @property
    def criteria(self) -> int:
        """How many criteria a fit goes through."""

    @property
    def final(self) -> int:
        """The criterion at which the fit of the model that is reported ends: the last one, or the same computed more
        exactly.
        """

    @property
    def judges(self) -> tuple[int, ...]:
        """Criteria that judge a model, block by block the one under which it fits better: an observer may lose a step
        that the free run keeps, and the free run one that the observer keeps.
        """

    @property
    def beginnings_s(self) -> tuple[float, ...]:
        """Lengths in s of ever longer beginnings of a record: the first holds a few slip events or impacts. None
        where records are no time series.
        """

    @property
    def slow_view(self) -> bool:
        """Whether `residual` knows a further criterion, number `criteria`, that shows only what is slow in the free
        run.
        """

    @property
    def least_gain(self) -> float:
        """Gain below which nothing is named: what two searches of the same criterion may differ by; large where it is
        jagged.
        """

    @property
    def next_share(self) -> float:
        """Share of the first effect's gain that a further effect must bring: small where a law can be exact, larger
        where a form that fits badly would call for others to mend it.
        """

    @property
    def equivalents(self) -> Mapping[str, tuple[str, ...]]:
        """Explanations that these data cannot tell from an effect though no fit tries them."""

    @property
    def base(self) -> tuple[Parameter, ...]:
        """The base parameters at their nominal values."""

    @property
    def effects(self) -> tuple[type[Effect], ...]:
        """The candidates."""
        ...

    def nominal(self) -> Theta:
        """The base parameters as believed."""

    def predict(self, record: Record, theta: Theta) -> Array:
        """The measured column as the model predicts it from the driven column alone; shape of the measured column."""

    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        """What a fit minimises: differences in units of their standard deviation, fixed length for a record, about unit
        variance and independent of each other where the model is right. `criterion` counts up to `criteria` - 1, from a
        criterion that is smooth but forgets (an observer keeps the model in step) to the one that is meant; most kinds
        have one criterion.
        """

    @property
    def lanes(self) -> int:
        """How many points `residuals` evaluates at about the price of one."""

    def residuals(self, record: Record, thetas: Sequence[Theta], criterion: int = 0) -> list[Array]:
        """`residual` at several points."""

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """The error measure that is reported (`measure` says in words which), pooled over the records."""

    def noise_floor(self, records: Sequence[Record]) -> float:
        """What a perfect model would leave of `error`: the sensors' noise (repeats' scatter) through the same
        measure.
        """

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """A record like `record` but measured on the model at `theta` with the noise believed: what chance alone looks
        like.
        """

    def measured(self, record: Record) -> Array:
        """The measured column, or columns, (n,) or (n, m)."""

    def signals(self, record: Record) -> dict[str, Array]:
        """What the residual may depend on, by name."""

    def extra_force(self, record: Record, theta: Theta) -> tuple[Array, Array] | None:
        """What the model at `theta` leaves of `record` as a force along +x that acts beyond it, and the force that
        moves the body, both (n,) in N (torques in N m); None where the residual is not one.
        """

    def searched(self, records: Sequence[Record]) -> list[Record]:
        """What of `records` a search looks at: all of them, or their beginnings where a run takes long and a short one
        tells as much.
        """

    def splits(self, records: Sequence[Record]) -> list[tuple[list[Record], list[Record]]]:
        """Splits into (training, validation) parts for cross-validation: by record, by condition, by sample; never
        within one.
        """


class _Residual(Protocol):
    @property
    def base(self) -> tuple[Parameter, ...]: ...

    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array: ...


class OneByOne:
    """A kind that evaluates one point at a time."""

    lanes: ClassVar[int] = 1
    beginnings_s: ClassVar[tuple[float, ...]] = ()

    def nominal(self: _Residual) -> Theta:
        """The base parameters as believed."""
        return Theta.declared(self.base)

    def residuals(self: _Residual, record: Record, thetas: Sequence[Theta], criterion: int = 0) -> list[Array]:
        """`residual` at several points."""
        return [self.residual(record, theta, criterion) for theta in thetas]

    def extra_force(self, record: Record, theta: Theta) -> tuple[Array, Array] | None:
        """None: the residual is no force."""
        return None

    def searched(self, records: Sequence[Record]) -> list[Record]:
        """All of them."""
        return list(records)


def parameters_of(effect: type[Effect], theta: Theta) -> dict[str, float] | None:
    """An effect's parameters in `theta`, at their defaults where left out; None where the effect is absent."""
    given = theta.effects.get(effect.id)
    return {p.name: given.get(p.name, p.value) for p in effect.parameters()} if given else None


def present(effects: Sequence[type[Effect]], theta: Theta) -> list[tuple[Effect, dict[str, float]]]:
    """The effects in `theta`, each with its parameters."""
    return [(effect(), values) for effect in effects if (values := parameters_of(effect, theta)) is not None]


def had(kind: Kind) -> frozenset[str]:
    """Ids of the effects that belong to the base of `kind`."""
    return frozenset(p.effect for p in kind.base if p.effect)


def declared(kind: Kind, effect: str) -> type[Effect]:
    """The `effect` as `kind` has it, with the kind's own ranges and names of parameters; else the catalogue's."""
    return next((own for own in kind.effects if own.id == effect), BY_ID[effect])
