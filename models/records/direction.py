"""Which way an axis is driven: by a force, from which its place follows, or along a place, which takes a force."""

from collections.abc import Collection, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.rigs.benches import AXIS, DRIVEN_AXIS
from models.rigs.columns import TIME
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.rig import Rig
from models.words.sentences import Sentences

Array = NDArray[np.float64]
TEXT: Final = Sentences(__file__)
_FORCES: Final = ("force_N", "torque_N_m")
_COMMANDED: Final = ("command", "voltage", "current")
_EXACTLY: Final = 1e-4  # share of a force by which it may differ from a command to be one


def kind_of(rig: Rig, columns: Collection[str]) -> RigKind:
    """The kind of a record of `rig` with these columns: an axis whose force nobody measured is driven by its current
    or voltage, one with a second encoder at the load by its force.
    """
    kind = KINDS[rig.kind]
    if kind is AXIS and any(name in columns for one in kind.layouts for name in one.beside):
        return DRIVEN_AXIS
    if kind is not AXIS or {*_FORCES} & set(columns):
        return kind
    return DRIVEN_AXIS if set(columns) & {*DRIVEN_AXIS.layout.driven[0]} else kind


def swings(kind: RigKind, columns: Collection[str]) -> bool:
    """Whether an axis that is to be driven swings freely: nothing beside its place, speed and load is logged."""
    return kind is DRIVEN_AXIS and any(
        {TIME, *one.measured} <= set(columns) <= {TIME, *one.measured, *one.optional} for one in kind.layouts
    )


def directed(kind: RigKind, columns: dict[str, Array], rig: Rig) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The columns with the force (torque) that drives a record, and a sentence where the rig file leaves that open."""
    layout = kind.columns(columns)
    if kind is AXIS:
        (force,) = layout.measured
        if rig.driven or force not in columns:
            return columns, ()
        return columns, (_measured(columns, force),)
    if kind is not DRIVEN_AXIS:
        return columns, ()
    (place,), force = layout.measured, layout.driven[0][0]
    if rig.driven in _FORCES and rig.driven != force and force in columns:
        raise ValueError(TEXT("other", force=force, place=place, driven=rig.driven))
    driven = rig.driven or next((name for name in layout.driven[0] if name in columns), "")
    rows = len(next(iter(columns.values())))
    constant = rig.axis.constant(driven) if driven in columns else 0.0
    if constant is None:
        said = TEXT("ratio", driven=driven, place=place, inertia=rig.axis.of(columns)[0])
        return {name: values for name, values in columns.items() if name != force}, (said,)
    pushed = constant * columns[driven] if driven in columns else np.zeros(rows)
    said = TEXT("driven" if driven in columns else "free", driven=driven, place=place)
    return {**columns, force: pushed}, () if rig.driven in columns else (said,)


def _measured(columns: Mapping[str, Array], force: str) -> str:
    """What is said of a force that is taken as measured: that it may be a command, where it equals one."""
    y = columns[force]
    for name, command in columns.items():
        power = float(command @ command)
        if any(word in name.lower() for word in _COMMANDED) and power > 0:
            factor = float(command @ y) / power
            if np.max(np.abs(y - factor * command)) <= _EXACTLY * np.max(np.abs(y)):
                return TEXT("command", force=force, column=name, factor=factor)
    return TEXT("measured", force=force)
