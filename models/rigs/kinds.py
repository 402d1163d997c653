"""The kinds of rig by their names in a rig file, and the surface and the drive that `models.assembly` takes."""

from collections.abc import Callable
from typing import Final

from models.drives.drive import Drive
from models.rigs.benches import AXIS, DMA, FRICTION, PERIODS, VIBRO_TABLE
from models.rigs.capsules import COIL, MAGNETIC, PULL, VIBRO
from models.rigs.kind import RigKind
from models.rigs.rig import Rig
from models.surfaces.gut import Wall
from models.surfaces.surface import Air, Plate, Surface

KINDS: Final[dict[str, RigKind]] = {
    kind.id: kind for kind in (PULL, MAGNETIC, COIL, VIBRO, VIBRO_TABLE, AXIS, PERIODS, FRICTION, DMA)
}


def surface_of(rig: Rig) -> Surface:
    """What the body lies on by `[surface]`; the gut where nothing is stated."""
    kind = "gut" if rig.surface is None else rig.surface.kind
    return SURFACES[kind](rig)


def drive_of(rig: Rig, driven: str = "") -> Drive:
    """The drive of a time-series rig; `driven` is the record's driven column, which for some may be `coil_voltage_V`.
    Raises ValueError for another kind of rig, and for a voltage where the rig file lacks the coil's numbers.
    """
    drive = KINDS[rig.kind].drive if rig.kind in KINDS else None
    if drive is None:
        known = ", ".join(name for name, kind in KINDS.items() if kind.of_capsule)
        raise ValueError(f"rig must be of a kind that gives time series of a capsule; got {rig.kind!r}; known: {known}")
    return drive(rig, driven == "coil_voltage_V")


def _plate(rig: Rig) -> Surface:
    friction = None if rig.surface is None else rig.surface.friction_coefficient
    return Plate(rig.capsule.mass_kg) if friction is None else Plate(rig.capsule.mass_kg, friction)


SURFACES: Final[dict[str, Callable[[Rig], Surface]]] = {
    "gut": lambda rig: Wall.around(rig.capsule, rig.tissue),
    "plate": _plate,
    "air": lambda rig: Air(rig.capsule.mass_kg),
}
"""The surfaces, by `kind` of `[surface]`."""
