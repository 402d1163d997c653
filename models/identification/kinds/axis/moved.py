"""How an axis moved in a record, as its inverse dynamics need it: filtered motion, sure directions, rests."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.checks.estimators import runs_of
from models.checks.usable import used
from models.identification.kinds.axis.coordinates import Coordinates
from models.identification.kinds.axis.noise import through, white_part
from models.identification.kinds.axis.zero_phase import Array, AxisMotion, motion
from models.identification.settings import SET
from models.records.record import Record

WHOLE, STILL, PLACE_NOISE = ("_x", "_v", "_a"), "_still", "_place_noise"
"""Columns that a part of a record carries on from the whole: the motion filtered before the cut, rests, noise."""


@dataclass(frozen=True)
class Moved:
    """The motion, the sign of its speed as far as the noise of the position (standard deviation `place`) lets it be
    told, where the axis rests, its direction is unsure or a gap is near (`still`), and the logged speed where it agrees
    with the position's.
    """

    motion: AxisMotion
    direction: Array
    still: NDArray[np.bool_]
    place: float
    logged: Array | None


def moved(record: Record, c: Coordinates, position_std: float | None, band: float) -> Moved:
    """The motion of `record`, whole or a part; `position_std` where it is stated, `band` of the filters in Hz."""
    if WHOLE[0] in record.columns:
        m = AxisMotion(record["t_s"], *(record[column] for column in WHOLE))
        place, still = float(record[PLACE_NOISE][0]), record[STILL] > 0.5
        return Moved(m, _direction(m, place, band), still, place, record.columns.get(c.velocity))
    position = record[c.position]
    m = motion(record["t_s"], position, band=band)
    logged = record.columns.get(c.velocity)
    if logged is not None:
        apart = float(np.sqrt(np.mean((m.v - logged) ** 2)))
        logged = logged if apart < SET.axis_agrees * float(np.sqrt(np.mean(m.v**2))) else None
    if logged is not None:
        m = motion(record["t_s"], position, logged, band)
    place = position_std or white_part(position)
    still = _still(m, place, band) | _beside_gaps(~used(record), m.rate, band)
    return Moved(m, _direction(m, place, band), still, place, logged)


def carried(record: Record, c: Coordinates, of: Moved) -> Record:
    """`record` with its motion as columns, for parts of it."""
    told = {**dict(zip(WHOLE, (of.motion.x, of.motion.v, of.motion.a), strict=True)), STILL: of.still.astype(float)}
    told[PLACE_NOISE] = np.full(len(record), of.place)
    kept = record if of.logged is not None else record.without((c.velocity,))
    return replace(kept, columns={**kept.columns, **told})


def _unsure(m: AxisMotion, place: float, band: float) -> float:
    """Speed that the noise of the position may feign, one standard deviation."""
    return through(round(m.rate, 3), band, False)[0] * place


def _direction(m: AxisMotion, place: float, band: float) -> Array:
    unsure = 2 * _unsure(m, place, band)
    return np.clip(m.v / unsure, -1, 1) if unsure > 0 else np.sign(m.v)


def _beside_gaps(unused: NDArray[np.bool_], rate: float, band: float) -> NDArray[np.bool_]:
    """The rows of gaps, and beside them as far as the filters reach."""
    out, reach = np.zeros_like(unused), round(SET.border / band * rate)
    for a, b in runs_of(unused):
        if b - a >= SET.axis_gap - 1:
            out[max(a - reach, 0) : b + reach] = True
    return out


def _still(m: AxisMotion, place: float, band: float) -> NDArray[np.bool_]:
    fast = np.abs(m.v)
    out = fast < 2 * _unsure(m, place, band)
    for a, b in runs_of(fast < max(SET.axis_rest * float(np.percentile(fast, 99)), 4 * _unsure(m, place, band))):
        out[a:b] |= (b - a) > SET.axis_rest_s * m.rate
    return out
