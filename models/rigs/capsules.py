"""Rigs that move a capsule: drawn along, by a magnet on a carriage, by a coil outside, or shaken by an inner mass."""

from dataclasses import fields
from typing import Any

from models.drives.coil import Coil, VoltageCoil, Winding
from models.drives.drive import Drive
from models.drives.magnetic import Magnetic, MagnetPair
from models.drives.pull import Pull
from models.drives.vibro import RatedVibro, Stop, Vibro, VoltageVibro
from models.rigs.columns import ACCELERATION, DRIVE_FORCE, Columns
from models.rigs.kind import IN_GUT, Instead, RigKind
from models.rigs.magnets import Magnet, Magnets, read_magnets
from models.rigs.rig import Head, Rig
from models.rigs.schema import Positive
from models.rigs.tables import ClockTable, CoilTable, DriveTable, SurfaceTable

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
"""A rig draws the capsule through the gut: its position is imposed, the force is measured."""


class MagneticHead(Head, Magnet):
    """`[rig]` with the pull's stiffness and range."""

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "magnet": Magnet(**self.model_dump(include=set(Magnet.model_fields)))}


class MagnetsHead(Head):
    """`[rig]` beside a table `[rig.magnet]`: a measured stiffness may stand there."""

    magnet_stiffness_N_per_m: Positive | None = None

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "magnets": nested, "magnet": nested.spring(self.magnet_stiffness_N_per_m)}


def _magnet_drive(rig: Rig, by_voltage: bool) -> Drive:
    magnet, both = rig.needed(rig.magnet), rig.magnets
    spring = magnet.magnet_stiffness_N_per_m, magnet.magnet_range_m
    return Magnetic(*spring) if both is None else MagnetPair(*spring, both.height_m, both.moments)


MAGNETIC = RigKind(
    id="magnetic",
    layouts=(Columns((("carriage_position_m",),), ("position_m",), beside=(ACCELERATION, DRIVE_FORCE)),),
    head=MagneticHead,
    instead=Instead("magnet", Magnets, read_magnets, MagnetsHead),
    tables=IN_GUT,
    further={"surface": SurfaceTable, "clock": ClockTable},
    nominal={"rig": {"magnet_stiffness_N_per_m": Magnetic().stiffness_N_per_m, "magnet_range_m": Magnetic().range_m}},
    drive=_magnet_drive,
    longest_s=3600.0,
    follows=True,
    hooks=frozenset({"gain"}),
)
"""A permanent magnet on a carriage draws the capsule: the carriage's position is driven, the capsule's is measured."""


class CoilHead(Head, CoilTable):
    """`[rig]` with the coil's numbers."""

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "coil": CoilTable(**self.model_dump(include=set(CoilTable.model_fields)))}


def _coil_drive(rig: Rig, by_voltage: bool) -> Drive:
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
    layouts=(Columns((("coil_current_A", "coil_voltage_V"),), ("position_m",), beside=(ACCELERATION, DRIVE_FORCE)),),
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
    drive=_coil_drive,
    longest_s=3600.0,
    switched=True,
    pushed=True,
    hooks=frozenset({"gain"}),
)
"""A coil outside the body pushes the capsule: its current or voltage is driven, the capsule's position is measured."""


def _vibro_drive(rig: Rig, by_voltage: bool) -> Drive:
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
    layouts=(Columns((("drive_on", "coil_voltage_V"),), ("position_m",), beside=(ACCELERATION,)),),
    tables={**IN_GUT, "drive": DriveTable, "surface": SurfaceTable},
    further={"clock": ClockTable},
    nominal={
        "capsule": {"mass_kg": 0.193},
        "drive": {
            name: getattr(Vibro(), name)
            for name in ("inner_mass_kg", "spring_stiffness_N_per_m", "force_N", "reaction_on_body")
        },
    },
    drive=_vibro_drive,
    longest_s=600.0,
    switched=True,
    vibrates=True,
    hooks=frozenset({"gain", "suspension", "reach"}),
)
"""An inner mass on a spring shakes the capsule along: its coil is switched, the capsule's position is measured."""
