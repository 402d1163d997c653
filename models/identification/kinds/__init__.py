"""The kinds of rig that the loop can work on."""

from __future__ import annotations

from collections.abc import Sequence

from models.identification.kinds.axis import AxisKind
from models.identification.kinds.dma import DmaKind
from models.identification.kinds.gut import GutKind
from models.identification.kinds.periods import PeriodsKind
from models.identification.kinds.vibro_table import VibroTableKind
from models.identification.kinds.zero_phase import evened
from models.record import Record, named
from models.rig import Rig

AnyKind = AxisKind | DmaKind | GutKind | PeriodsKind | VibroTableKind


def kind_for(rig: Rig, records: Sequence[Record]) -> AnyKind:
    """The kind that a rig file describes; `records` settle what only data can (noise, the sign of a table's velocities)."""
    if rig.kind == "axis":
        return AxisKind.from_rig(rig)
    if rig.kind == "dma":
        return DmaKind.from_rig(rig)
    if rig.kind == "periods":
        return PeriodsKind.from_rig(rig)
    if rig.kind == "vibro_table":
        table = VibroTableKind.from_rig(rig)
        return table.settled(records) if records and "mean_velocity_m_s" in records[0].columns else table
    return GutKind.from_rig(rig, records)


def ready(record: Record) -> Record:
    """`record` as its kind works on it: a stage's at even times."""
    if record.kind != "axis":
        return record
    with named(record):
        return evened(record, ("position_m", "force_N"))
