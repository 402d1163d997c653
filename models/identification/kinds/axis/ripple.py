"""Is what remains of a stage's force periodic in position: cogging of the motor, ripple of the ball screw."""

import math
from dataclasses import dataclass

import numpy as np

from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.axis.zero_phase import decimate, sampling_rate
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class Ripple:
    """Amplitude in N (N m), wavelength in m (rad), phase in rad at x = 0, share of the residual's power, its chance."""

    amplitude: float
    wavelength: float
    phase_rad: float
    share: float
    p: float


def find_ripple(kind: AxisKind, record: Record, theta: Theta) -> Ripple | None:
    """The strongest `A sin(2 pi x/L + phi)` in the filtered residual; None where chance gives as much once in a
    hundred.

    Wavelengths a quarter turn apart over the stroke; the chance counts all of them and one independent sample in three.
    """
    rate = sampling_rate(record["t_s"])
    c = kind.coordinates
    x = kind.signals(record)[c.names[0]]
    e = kind.residual(record, theta) * kind.noise(record).weight
    e = e - e.mean()
    step = 0.25 / max(float(np.ptp(x)), 1e-6)
    shortest, longest = (SET.pole_min_rad, SET.pole_max_rad) if c.turns else (SET.lead_min_m, SET.lead_max_m)
    waves = np.arange(1 / longest, 1 / shortest, step)
    best, found = 0.0, None
    for wave in waves:
        angle = 2 * math.pi * wave * x
        pair = np.column_stack([decimate(np.sin(angle), rate, kind.band), decimate(np.cos(angle), rate, kind.band)])
        weights, *_ = np.linalg.lstsq(pair, e, rcond=None)
        share = 1 - float(np.sum((e - pair @ weights) ** 2) / np.sum(e**2))
        if share > best:
            best, found = share, (wave, weights)
    p = min(1.0, len(waves) * (1 - best) ** (len(e) / 6))
    if found is None or p > SET.significant:
        return None
    wave, (sine, cosine) = found
    return Ripple(math.hypot(sine, cosine), float(1 / wave), math.atan2(cosine, sine), best, p)
