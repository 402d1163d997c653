"""A stiff pull: the rig imposes the capsule's position and measures the force."""

from dataclasses import dataclass
from typing import ClassVar

from models.drives.drive import Drive


@dataclass(frozen=True)
class Pull(Drive):
    """Imposed position in m, measured pull in N, positive towards +x."""

    name: ClassVar[str] = "pull"
    commanded: ClassVar[str] = "position_m"
    measured: ClassVar[str] = "force_N"
    imposed: ClassVar[bool] = True
    anchored: ClassVar[bool] = True
    leaves_open: ClassVar[tuple[str, ...]] = ()
