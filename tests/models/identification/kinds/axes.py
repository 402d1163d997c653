"""Axes by their numbers."""

from models.identification.kinds.axis.axis import AxisKind
from models.rigs.rig import Rig
from models.rigs.tables import Axis


def axis_kind(*values: float) -> AxisKind:
    """A stage with these nominal mass, viscous and Coulomb friction and offset."""
    names = ("mass_kg", "viscous_friction_N_s_per_m", "coulomb_friction_N", "offset_N")
    return AxisKind.from_rig(Rig("axis", axis=Axis(**dict(zip(names, values, strict=True)))))
