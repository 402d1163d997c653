"""A series whose records differ by what the rig file states of each, `[[record]]`, and share all else."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from models.identification.kind import Kind
from models.records.record import Record
from models.theta import Theta

_BY_RECORD: Final = ("predict", "predictions", "residual", "stacked", "imitate", "extra_force")


def differing(kind: Kind, own: Mapping[str, Kind]) -> Kind:
    """`kind`, which takes for the records of some names their `own` kind. Of a parameter that a fit may change, the
    difference of its nominal values stays.
    """
    nominal = kind.nominal()
    shifts = {
        name: {key: value - nominal[key] for key, value in other.nominal().items() if value != nominal[key]}
        for name, other in own.items()
    }

    def shifted(theta: Any, by: Mapping[Any, float]) -> Any:
        if not isinstance(theta, Theta):
            return [shifted(one, by) for one in theta]
        return theta | {key: theta[key] + change for key, change in by.items()}

    def method(name: str) -> Callable[..., Any]:
        def called(self: Kind, record: Record, theta: Theta | Sequence[Theta], *rest: Any) -> Any:
            of = record.name.rpartition("/")[2]
            if of in own:
                return getattr(own[of], name)(record, shifted(theta, shifts[of]), *rest)
            return getattr(super(made, self), name)(record, theta, *rest)

        return called

    made: type[Any] = type(type(kind).__name__, (type(kind),), {name: method(name) for name in _BY_RECORD})
    same: Kind = object.__new__(made)
    for name, value in vars(kind).items():
        object.__setattr__(same, name, value)
    return same
