"""A rig draws the capsule through the gut: its position is imposed, the force is measured."""

from models.drives.pull import Pull
from models.rigs.columns import Columns
from models.rigs.kind import IN_GUT, RigKind
from models.rigs.tables import ClockTable

PULL = RigKind(
    id="pull",
    layouts=(Columns((("position_m",),), ("force_N",)),),
    tables=IN_GUT,
    further={"clock": ClockTable},
    drive=lambda rig, by_voltage: Pull(),
    longest_s=3600.0,
    drawn=True,
    hooks=frozenset({"link"}),
)
