"""The residual of records while the capsule moves, as a force where it is one, beside the signals it may depend on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class Left:
    """Samples (n,): `values` of the residual along +x in `unit`, the `signals` by name, the `direction` of motion, the
    size of the force that moves the body (`acting`; 0 where none is told), the `stretch` and the `fold` (the record,
    where there are several) that each belongs to.
    """

    quantity: str
    unit: str
    values: Array
    signals: dict[str, Array]
    direction: Array
    acting: Array
    stretch: NDArray[np.int64]
    fold: NDArray[np.int64]

    def along(self, way: str) -> Array:
        """The values along +x, or against the motion ("-v"), where a resistance is positive."""
        return self.values if way == "+x" else -self.direction * self.values


def left_of(kind: Kind, records: Sequence[Record], theta: Theta) -> Left | None:
    """What the model at `theta` leaves of `records`; None for several measured columns and for tables."""
    signals = [{name: y for name, y in kind.signals(record).items() if name != kind.quantity} for record in records]
    speed = next((name for name in signals[0] if name.startswith("v_")), None)
    if speed is None or any(np.ndim(kind.measured(record)) != 1 for record in records):
        return None
    least = SET.residual_moving * max(float(np.nanmax(np.abs(own[speed]))) for own in signals)
    names = [name for name in signals[0] if all(name in own for own in signals)]
    forced, parts = False, []
    for number, (record, own) in enumerate(zip(records, signals, strict=True)):
        told = kind.extra_force(record, theta)
        forced = told is not None
        rest, acting = told or (kind.measured(record) - kind.predict(record, theta), np.zeros(len(record)))
        stretch = np.arange(len(rest)) * SET.residual_stretches // len(rest)
        fold = np.full(len(rest), number) if len(records) > 1 else stretch % SET.residual_folds
        columns = [rest, np.sign(own[speed]), np.abs(acting), number * SET.residual_stretches + stretch, fold]
        good = np.all([np.isfinite(y) for y in (*own.values(), *columns)], axis=0) & (np.abs(own[speed]) > least)
        parts.append([column[good] for column in (*columns, *(own[name] for name in names))])
    values, direction, acting, stretch, fold, *rows = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Left(
        "extra force" if forced else kind.quantity,
        "N" if forced and kind.unit == "m" else kind.unit,
        values,
        dict(zip(names, rows, strict=True)),
        direction,
        acting,
        stretch.astype(np.int64),
        fold.astype(np.int64),
    )
