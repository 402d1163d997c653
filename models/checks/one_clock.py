"""A record whose measured columns were stamped by a clock that drifts, brought to that of the driven one."""

from __future__ import annotations

import numpy as np

from models.checks.instrument.resolution import PLACES
from models.files.columns import TIME
from models.files.record import Record
from models.files.rig import Rig


def on_one_clock(record: Record, rig: Rig) -> Record:
    """`record` with the drift of `[clock]` taken out: measured values stay as they are and get the driven columns'
    stamps, `t - drift (t - t_0)`, at which a driven place is read between its samples. Unchanged where no drift is
    stated or the drive is no place: a command that switches cannot be read between samples.
    """
    if rig.clock is None or not rig.clock.drift or TIME not in record.columns:
        return record
    driven = [name for names in record.layout.driven for name in names if name in record.columns]
    if not driven or any(name not in PLACES for name in driven):
        return record
    logged = record[TIME]
    true = logged - rig.clock.drift * (logged - logged[0])
    if np.any(np.diff(logged) <= 0):  # stamps that the checks refuse
        return record
    for name in driven:
        record = record.with_column(name, np.interp(true, logged, record[name]))
    return record.with_column(TIME, true)
