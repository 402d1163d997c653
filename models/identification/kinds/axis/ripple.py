"""Is what remains of a stage's force periodic in position: cogging of the motor, ripple of the ball screw."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from models.files.record import Record
from models.identification.kinds.axis.kind import AxisKind
from models.identification.kinds.axis.zero_phase import decimate, sampling_rate
from models.theta import Theta

SHORTEST_M, LONGEST_M = 1.5e-3, 2e-2
"""Leads and pole pitches of usual drives; 2 mm is about the shortest at 0.1 m/s that the 40 Hz filter passes."""
SHORTEST_RAD, LONGEST_RAD = 2 * math.pi / 100, 2 * math.pi / 4
"""Poles, slots and teeth of usual motors and gears in a turn."""


@dataclass(frozen=True)
class Ripple:
    """Amplitude in N (N m), wavelength in m (rad), phase in rad at x = 0, share of the residual's mean square, and its
    chance.
    """

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
    shortest, longest = (SHORTEST_RAD, LONGEST_RAD) if c.turns else (SHORTEST_M, LONGEST_M)
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
    if found is None or p > 0.01:
        return None
    wave, (sine, cosine) = found
    return Ripple(math.hypot(sine, cosine), float(1 / wave), math.atan2(cosine, sine), best, p)
