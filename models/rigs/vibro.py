"""An inner mass on a spring shakes the capsule along: its coil is switched, the capsule's position is measured."""

from dataclasses import fields

from models.drives.coil import Winding
from models.drives.drive import Drive
from models.drives.vibro import RatedVibro, Stop, Vibro, VoltageVibro
from models.rigs.columns import Columns
from models.rigs.kind import IN_GUT, RigKind
from models.rigs.rig import Rig
from models.rigs.tables import ClockTable, DriveTable, SurfaceTable


def _drive(rig: Rig, by_voltage: bool) -> Drive:
    d = rig.needed(rig.drive)
    stiff = d.stop_stiffness_N_per_m
    front, rear = (
        None if gap is None or stiff is None else Stop(gap, stiff) for gap in (d.front_stop_gap_m, d.rear_stop_gap_m)
    )
    own = d.model_dump(include={field.name for field in fields(Vibro)}) | {"front": front, "rear": rear}
    if not by_voltage:
        return Vibro(**own)
    if d.rated_voltage_V is not None:
        return RatedVibro(**own, rated_voltage_V=d.rated_voltage_V)
    if d.coil_resistance_Ohm is None or d.force_constant_N_per_A is None:
        raise ValueError(
            "[drive] must have the key 'rated_voltage_V', or 'force_constant_N_per_A' and 'coil_resistance_Ohm', where"
            " the coil is driven by a voltage; they are missing"
        )
    winding = Winding.of(d.coil_resistance_Ohm, d.coil_inductance_H, d.current_limit_A, d.force_constant_N_per_A)
    return VoltageVibro(**own, coil_force_N_per_A=d.force_constant_N_per_A, winding=winding)


VIBRO = RigKind(
    id="vibro",
    layouts=(Columns((("drive_on", "coil_voltage_V"),), ("position_m",)),),
    tables={**IN_GUT, "drive": DriveTable, "surface": SurfaceTable},
    further={"clock": ClockTable},
    nominal={
        "capsule": {"mass_kg": 0.193},
        "drive": {
            name: getattr(Vibro(), name)
            for name in ("inner_mass_kg", "spring_stiffness_N_per_m", "force_N", "reaction_on_body")
        },
    },
    drive=_drive,
    longest_s=600.0,
    switched=True,
    vibrates=True,
    hooks=frozenset({"gain", "suspension", "reach"}),
)
