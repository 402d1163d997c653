"""Logged inputs of an axis: which of them push, and which scale its friction, by regression of the force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.checks.excitation import varied
from models.files.units import unit_of
from models.identification.kind import Array
from models.identification.kinds.axis.coordinates import Coordinates
from models.identification.kinds.axis.zero_phase import decimate, motion
from models.identification.settings import SET
from models.records.record import Record


@dataclass(frozen=True)
class Logged:
    """A logged input by its `name` in parameters: its unit, usual size and span, and whether it stands out as one that
    pushes, and as one that scales the friction.
    """

    name: str
    unit: str
    size: float = 1.0
    span: float = 1.0
    pushes: bool = True
    scales: bool = True


def logged_in(records: Sequence[Record], c: Coordinates, loads: Mapping[str, str], band: float) -> tuple[Logged, ...]:
    """The inputs `loads`, name and column, of `records`: those first that explain most of the force."""
    units = {name: unit_of(column).replace("_", " ") or "1" for name, column in loads.items()}
    if not records or not loads:
        return tuple(Logged(name, units[name]) for name in loads)
    motions = [motion(r["t_s"], r[c.position], band=band) for r in records]

    def joined(of: Sequence[Array]) -> Array:
        return np.concatenate([decimate(one, m.rate, band) for one, m in zip(of, motions, strict=True)])

    force = joined([r[c.force] for r in records])
    parts = ("a", "v", "x")
    base = [joined([getattr(m, part) for m in motions]) for part in parts]
    base += [joined([np.sign(m.v) for m in motions]), np.ones(len(force))]
    pushing = {name: joined([r[column] for r in records]) for name, column in loads.items()}
    values = {name: np.concatenate([r[column] for r in records]) for name, column in loads.items()}
    varying = [name for name, column in loads.items() if varied(column, values[name])]
    first = _ranked(force, base, {name: pushing[name] for name in varying})
    scaling = {
        name: joined([np.sign(m.v) * np.abs(r[column]) for m, r in zip(motions, records, strict=True)])
        for name, column in loads.items()
        if name in varying
    }
    second = _ranked(force, [*base, *(pushing[name] for name in first)], scaling)
    both = [*first, *(name for name in loads if name not in first)]
    sizes = {name: float(np.percentile(np.abs(one), 98)) or 1.0 for name, one in values.items()}
    spans = {name: float(np.ptp(np.percentile(one, [2, 98]))) or 1.0 for name, one in values.items()}
    return tuple(Logged(n, units[n], sizes[n], spans[n], n in first, n in second) for n in both)


def _ranked(y: Array, base: Sequence[Array], more: Mapping[str, Array]) -> list[str]:
    """The names of `more` that take a share of what is left of `y` beside `base`, in the order of what they explain."""

    def left(names: Sequence[str]) -> float:
        rows = np.column_stack([*base, *(more[name] for name in names)])
        rows = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
        weights, *_ = np.linalg.lstsq(rows, y, rcond=None)
        return float(np.sum((y - rows @ weights) ** 2))

    found, power = list[str](), np.inf
    while len(found) < len(more):
        best = min((name for name in more if name not in found), key=lambda name: left([*found, name]))
        now = left([*found, best])
        if found and now > (1 - SET.axis_pushes) * power:
            break
        found, power = [*found, best], now
    return found
