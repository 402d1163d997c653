"""The base model's stick-slip at 0.5 and 10 mm/s against what papers A and C measured there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hil.app.papers.analytical import mean_of
from hil.app.papers.flat_car import measured_teeth
from hil.app.papers.row import Row, Verdict, row, speed_key
from hil.app.papers.viscoelastic import measured_band
from models.identification.kinds.periods.kind import Cycle, PeriodsKind

SLOW, FAST = 0.5e-3, 10e-3


def base_cycle(speed_m_s: float) -> Cycle:
    """The base model's tooth for the default capsule and gut, nothing fitted."""
    kind = PeriodsKind.around(velocity_m_s=speed_m_s)
    return kind.cycle(speed_m_s, kind.nominal())


def two_speeds_rows() -> Iterator[Row]:
    """Period, valley and peak at both speeds."""
    measured = {
        SLOW: (mean_of("period_s"), mean_of("valley_N"), mean_of("peak_N")),
        FAST: (float(np.mean(measured_teeth("period"))), *measured_band()),
    }
    miss: Verdict = "misses the measurement"
    note = (
        "default capsule, nothing fitted, against A Table 2 and C, A 5.1: the measured period rises with speed, the"
        " base model's falls, whatever is fitted"
    )
    for v, values in measured.items():
        cycle = base_cycle(v)
        for name, unit, computed, seen in (
            ("period", "s", cycle.tooth.period_s, values[0]),
            ("valley", "mN", cycle.valley, values[1]),
            ("peak", "mN", cycle.peak, values[2]),
        ):
            quantity = f"base model: {name} at {v * 1e3:g} mm/s"
            yield row(f"base_{name}_{speed_key(v)}", quantity, unit, computed, miss, note, measured=seen)
