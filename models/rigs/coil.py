"""A coil outside the body pushes the capsule: its current or voltage is driven, the capsule's position is measured."""

from typing import Any

from models.drives.coil import Coil, VoltageCoil, Winding
from models.drives.drive import Drive
from models.rigs.columns import Columns
from models.rigs.kind import IN_GUT, RigKind
from models.rigs.rig import Head, Rig
from models.rigs.tables import ClockTable, CoilTable, SurfaceTable


class CoilHead(Head, CoilTable):
    """`[rig]` with the coil's numbers."""

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "coil": CoilTable(**self.model_dump(include=set(CoilTable.model_fields)))}


def _drive(rig: Rig, by_voltage: bool) -> Drive:
    c = rig.needed(rig.coil)
    if not by_voltage:
        return Coil(c.force_constant_N_per_A, c.coil_position_m, c.coil_range_m)
    if c.coil_resistance_Ohm is None:
        raise ValueError(
            "[rig] must have the key 'coil_resistance_Ohm' where the coil is driven by a voltage; it is missing"
        )
    winding = Winding.of(c.coil_resistance_Ohm, c.coil_inductance_H, c.current_limit_A, c.force_constant_N_per_A)
    return VoltageCoil(c.force_constant_N_per_A, c.coil_position_m, c.coil_range_m, winding)


COIL = RigKind(
    id="coil",
    layouts=(Columns((("coil_current_A", "coil_voltage_V"),), ("position_m",)),),
    head=CoilHead,
    tables=IN_GUT,
    further={"surface": SurfaceTable, "clock": ClockTable},
    nominal={
        "rig": {
            "force_constant_N_per_A": Coil().force_constant_N_per_A,
            "coil_resistance_Ohm": Winding().resistance_ohm,
            "coil_inductance_H": Winding().inductance_H,
            "current_limit_A": Winding().current_limit_A,
        }
    },
    drive=_drive,
    longest_s=3600.0,
    switched=True,
    pushed=True,
    hooks=frozenset({"gain"}),
)
