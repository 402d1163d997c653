"""A record whose measured columns were stamped by a clock that drifts, brought to that of the driven one."""

import numpy as np

from models.records.record import Record
from models.rigs.columns import TIME
from models.rigs.rig import Rig


def on_one_clock(record: Record, rig: Rig) -> Record:
    """`record` with the drift of `[clock]` taken out: measured values stay as they are and get the driven columns'
    stamps, `t - drift (t - t_0)`, at which a driven place is read between its samples; rows after its last one are left
    out. Unchanged where no drift is stated, and where stamps do not rise, which the checks refuse.
    """
    if rig.clock is None or not rig.clock.drift or TIME not in record.columns or np.any(np.diff(record[TIME]) <= 0):
        return record
    logged = record[TIME]
    true = logged - rig.clock.drift * (logged - logged[0])
    for name in {name for names in record.layout.driven for name in names if name in record.columns}:
        record = record.with_column(name, np.interp(true, logged, record[name]))
    return record.with_column(TIME, true).rows(slice(int(np.searchsorted(true, logged[-1], side="right"))))
