"""What a residual that no known effect explains depends on: state, time, a tone; and the term that is proposed."""

import itertools
from collections.abc import Sequence
from typing import Final

import numpy as np
import scipy

from models.identification.finding import Dependence, ResidualCurve, ResidualSurface, Tone
from models.identification.kind import Array, Kind
from models.identification.residual.curve import curve_of, ranked, surface_of
from models.identification.residual.left import Left, left_of
from models.identification.residual.term import SYMBOLS, term_of
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.columns import TIME
from models.theta import Theta

WAYS: Final = ("-v", "+x")


def dependence_of(kind: Kind, records: Sequence[Record], theta: Theta, seed: int = 0) -> Dependence | None:
    """What the model at `theta` leaves of the training `records` depends on; None where it is no series in time."""
    left = left_of(kind, records, theta) if records else None
    if left is None or len(left.values) < 2:
        return None
    rng = np.random.default_rng(seed)
    curves = ranked([curve_of(left, name, way, rng) for name in left.signals for way in WAYS])
    proposed = next((c for c in curves if c.variable in SYMBOLS and c.share >= SET.curve_tells), None)
    term = None
    if proposed is not None and kind.extra_force(records[0], theta) is not None:
        term = term_of(proposed, left.unit, float(left.acting.mean()))
    return Dependence(
        left.quantity,
        left.unit,
        tuple(record.name for record in records),
        curves,
        _surface(left, curves, rng),
        _tone(kind, records, theta),
        term,
    )


def _surface(left: Left, curves: Sequence[ResidualCurve], rng: np.random.Generator) -> ResidualSurface | None:
    """The best surface over two of the variables that foretell most, where it foretells clearly more than a curve."""
    if not curves:
        return None
    names = [curve.variable for curve in curves[: SET.surface_paired]]
    pairs = [surface_of(left, pair, way, rng) for pair in itertools.combinations(names, 2) for way in WAYS]
    best = max(pairs, key=lambda surface: surface.share, default=None)
    return best if best is not None and best.share > curves[0].share + SET.surface_more else None


def _tone(kind: Kind, records: Sequence[Record], theta: Theta) -> Tone | None:
    """The strongest line of the spectrum of the residual that the motion does not have."""
    if any(TIME not in record.columns for record in records):
        return None
    rows = min(map(len, records))
    spectra: list[Array] = []
    motions: list[Array] = []
    for record in records:
        step = float(record[TIME][-1] - record[TIME][0]) / (len(record) - 1)
        own = kind.signals(record)
        place = next((signal for name, signal in own.items() if name.startswith("x_")), np.zeros(len(record)))
        for found, signal in ((spectra, kind.measured(record) - kind.predict(record, theta)), (motions, place)):
            f, power = scipy.signal.welch(np.nan_to_num(signal), 1 / step, nperseg=rows, detrend="linear")
            found.append(power / max(float(power.sum()), 1e-300))
    spectrum, motion = np.mean(spectra, axis=0), np.mean(motions, axis=0)
    peak = SET.cycles + int(np.argmax(spectrum[SET.cycles :])) if len(spectrum) > SET.cycles else 0
    if not peak:
        return None
    line = slice(peak - 1, peak + 2)
    share = float(spectrum[line].sum())
    told = share >= SET.residual_tone and float(motion[line].sum()) < SET.residual_motion * share
    return Tone(float(f[peak]), share) if told else None
