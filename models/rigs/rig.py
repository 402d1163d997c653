"""The nominal values of a rig, as plain records."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from models.laws.geometry import Capsule, Tissue
from models.rigs.magnets import Magnet, Magnets
from models.rigs.mapping import ColumnMap
from models.rigs.schema import Table
from models.rigs.tables import Axis, ChecksTable, ClockTable, CoilTable, Contact, DriveTable, Noise, SurfaceTable

T = TypeVar("T")


@dataclass(frozen=True)
class Rig:
    """A rig of one kind with its nominal values; a part that this kind does not have is None or the default capsule and
    gut. `driven` is the driven column that an axis' rig file names. `own` has the tables that no other kind has, by
    name. `prior` has the standard deviations with which nominal
    values of what calibration fits are known, by name. `own_effects` are those from outside
    that may act in it, each as `models.effects.own.Origin`. `differing` are the rigs of records that differ, by name.
    """

    kind: str
    driven: str = ""
    capsule: Capsule = field(default_factory=Capsule)
    tissue: Tissue = field(default_factory=Tissue)
    noise: Noise = field(default_factory=Noise)
    checks: ChecksTable = field(default_factory=ChecksTable)
    clock: ClockTable | None = None
    magnet: Magnet | None = None
    magnets: Magnets | None = None
    coil: CoilTable | None = None
    drive: DriveTable | None = None
    surface: SurfaceTable | None = None
    axis: Axis = field(default_factory=Axis)
    contact: Contact = field(default_factory=Contact)
    velocity_m_s: float | None = None
    name: str = ""
    columns: ColumnMap = ColumnMap()
    prior: Mapping[str, float] = field(default_factory=dict)
    own: Mapping[str, Table] = field(default_factory=dict)
    own_effects: tuple[Any, ...] = ()
    differing: Mapping[str, "Rig"] = field(default_factory=dict)

    def needed(self, part: T | None) -> T:
        """A part that the rig's kind has; ValueError where it lacks it."""
        if part is None:
            raise ValueError(f"rig of kind {self.kind!r} must have the numbers of its drive; got none")
        return part


def at_height(rig: Rig, height_m: float) -> Rig:
    """The same rig with its magnets at another height: the stiffness goes with its inverse fifth power, the range with
    it. Raises ValueError for a rig without `[rig.magnet]`.
    """
    if rig.magnets is None or rig.magnet is None:
        raise ValueError("rig must have a table [rig.magnet] to have another height; got none")
    share = height_m / rig.magnets.height_m
    spring = Magnet(
        magnet_stiffness_N_per_m=rig.magnet.magnet_stiffness_N_per_m / share**5,
        magnet_range_m=rig.magnet.magnet_range_m * share,
    )
    return replace(rig, magnet=spring, magnets=rig.magnets.model_copy(update={"height_m": height_m}))


class Head(Table):
    """`[rig]` of a kind without further keys there."""

    kind: str
    name: str = ""

    def parts(self, nested: Any) -> dict[str, Any]:
        """Its fields of a `Rig`; `nested` is the table within it, None where there is none."""
        return {"name": self.name}
