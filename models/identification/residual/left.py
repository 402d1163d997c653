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
    """What the model at `theta` leaves of `records`; None for measurements of several columns and for tables, whose
    rows are no samples in time.
    """
    signals = [_signals(kind, record) for record in records]
    speed = next((name for name in signals[0] if name.startswith("v_")), None)
    if speed is None or any(np.ndim(kind.measured(record)) != 1 for record in records):
        return None
    least = SET.residual_moving * max(float(np.nanmax(np.abs(own[speed]))) for own in signals)
    parts = [
        _part(kind, record, theta, own, speed, least, i if len(records) > 1 else None, i)
        for i, (record, own) in enumerate(zip(records, signals, strict=True))
    ]
    names = [name for name in signals[0] if all(name in own for own in signals)]
    forced = kind.extra_force(records[0], theta) is not None
    whole = {
        key: np.concatenate([part[key] for part in parts])
        for key in ("values", "direction", "acting", "stretch", "fold", *names)
    }
    return Left(
        "extra force" if forced else kind.quantity,
        "N" if forced and kind.unit == "m" else kind.unit,
        whole["values"],
        {name: whole[name] for name in names},
        whole["direction"],
        whole["acting"],
        whole["stretch"].astype(np.int64),
        whole["fold"].astype(np.int64),
    )


def _signals(kind: Kind, record: Record) -> dict[str, Array]:
    """The kind's own signals but the measured column itself."""
    return {name: signal for name, signal in kind.signals(record).items() if name != kind.quantity}


def _part(
    kind: Kind,
    record: Record,
    theta: Theta,
    own: dict[str, Array],
    speed: str,
    least: float,
    fold: int | None,
    number: int,
) -> dict[str, Array]:
    """The moving samples of one record, by name."""
    told = kind.extra_force(record, theta)
    rest, acting = told or (kind.measured(record) - kind.predict(record, theta), np.zeros(len(record)))
    stretch = np.arange(len(rest)) * SET.residual_stretches // len(rest)
    columns = {
        **own,
        "values": rest,
        "direction": np.sign(own[speed]),
        "acting": np.abs(acting),
        "stretch": number * SET.residual_stretches + stretch,
        "fold": stretch % SET.residual_folds if fold is None else np.full(len(rest), fold),
    }
    good = np.all([np.isfinite(column) for column in columns.values()], axis=0) & (np.abs(own[speed]) > least)
    return {name: column[good] for name, column in columns.items()}
