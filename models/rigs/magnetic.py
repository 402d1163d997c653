"""A permanent magnet on a carriage draws the capsule: the carriage's position is driven, the capsule's is measured."""

from typing import Any

from models.drives.drive import Drive
from models.drives.magnetic import Magnetic, MagnetPair
from models.rigs.columns import Columns
from models.rigs.kind import IN_GUT, Instead, RigKind
from models.rigs.magnets import Magnet, Magnets, read_magnets
from models.rigs.rig import Head, Rig
from models.rigs.schema import Positive
from models.rigs.tables import ClockTable, SurfaceTable


class MagneticHead(Head, Magnet):
    """`[rig]` with the pull's stiffness and range."""

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "magnet": Magnet(**self.model_dump(include=set(Magnet.model_fields)))}


class MagnetsHead(Head):
    """`[rig]` beside a table `[rig.magnet]`: a measured stiffness may stand there."""

    magnet_stiffness_N_per_m: Positive | None = None

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "magnets": nested, "magnet": nested.spring(self.magnet_stiffness_N_per_m)}


def _drive(rig: Rig, by_voltage: bool) -> Drive:
    magnet, both = rig.needed(rig.magnet), rig.magnets
    spring = magnet.magnet_stiffness_N_per_m, magnet.magnet_range_m
    return Magnetic(*spring) if both is None else MagnetPair(*spring, both.height_m, both.moments)


MAGNETIC = RigKind(
    id="magnetic",
    layouts=(Columns((("carriage_position_m",),), ("position_m",)),),
    head=MagneticHead,
    instead=Instead("magnet", Magnets, read_magnets, MagnetsHead),
    tables=IN_GUT,
    further={"surface": SurfaceTable, "clock": ClockTable},
    nominal={"rig": {"magnet_stiffness_N_per_m": Magnetic().stiffness_N_per_m, "magnet_range_m": Magnetic().range_m}},
    drive=_drive,
    longest_s=3600.0,
    follows=True,
    hooks=frozenset({"gain"}),
)
