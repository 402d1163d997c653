"""The kinds of rig by their names in a rig file, and the surface and the drive that `models.assembly` takes."""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Final

from models.drives.coil import Winding
from models.drives.drive import Drive
from models.rigs.benches import AXIS, DMA, DRIVEN_AXIS, FRICTION, PERIODS, VIBRO_TABLE
from models.rigs.capsules import COIL, MAGNETIC, PULL, VIBRO
from models.rigs.kind import RigKind
from models.rigs.rig import Rig
from models.surfaces.gut import Wall
from models.surfaces.surface import Air, Plate, Surface

_TURNED: Final = {DRIVEN_AXIS.id: DRIVEN_AXIS}


class _Kinds(dict[str, RigKind]):
    """Kinds by name: those that a rig file names, and, without being listed, those that one of them turns to."""

    def __missing__(self, name: str) -> RigKind:
        return _TURNED[name]


KINDS: Final[dict[str, RigKind]] = _Kinds(
    (kind.id, kind) for kind in (PULL, MAGNETIC, COIL, VIBRO, VIBRO_TABLE, AXIS, PERIODS, FRICTION, DMA)
)


def freely(rig: Rig, turns: bool = False) -> Rig:
    """`rig` as one that is driven, where a model of its kind serves both directions."""
    if rig.kind not in (AXIS.id, DRIVEN_AXIS.id):
        return rig
    free = rig.axis.constant(rig.driven) is None
    return replace(rig, kind=DRIVEN_AXIS.id, driven=rig.driven if free else "torque_N_m" if turns else "force_N")


def named(kind: str) -> str:
    """The name of a kind in a rig file."""
    return _TURNED[kind].turned if kind in _TURNED else kind


def surface_of(rig: Rig) -> Surface:
    """What the body lies on by `[surface]`; the gut where nothing is stated."""
    own = KINDS[rig.kind].surface
    if own is not None:
        return own(rig)
    kind = "gut" if rig.surface is None else rig.surface.kind
    return SURFACES[kind](rig)


def drive_of(rig: Rig, driven: str = "") -> Drive:
    """The drive of a time-series rig; `driven` is the record's driven column, which for some may be `coil_voltage_V`.
    Raises ValueError for another kind of rig, and for a voltage where the rig file lacks the coil's numbers.
    """
    drive = KINDS[rig.kind].drive if named(rig.kind) in KINDS else None
    if drive is None:
        known = ", ".join(name for name, kind in KINDS.items() if kind.of_capsule)
        raise ValueError(f"rig must be of a kind that gives time series of a capsule; got {rig.kind!r}; known: {known}")
    return drive(rig, driven == "coil_voltage_V")


def driven_by(values: Collection[object]) -> str:
    """The driven column of a model that has parameters named `values`, as `drive_of` takes it: a coil's voltage where
    they have its resistance, "" for the usual one.
    """
    voltage = {p.key for p in Winding().parameters()} <= {*values}
    return "coil_voltage_V" if voltage else ""


SURFACES: Final[dict[str, Callable[[Rig], Surface]]] = {
    "gut": lambda rig: Wall.around(rig.capsule, rig.tissue),
    "plate": lambda rig: Plate(rig.capsule.mass_kg, rig.needed(rig.needed(rig.surface).friction_coefficient)),
    "air": lambda rig: Air(rig.capsule.mass_kg),
}
"""The surfaces, by `kind` of `[surface]`."""
