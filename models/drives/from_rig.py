"""From a rig file to the surface and the drive that `models.assembly.model.assemble` takes."""

from __future__ import annotations

from models.drives.coil import Coil, VoltageCoil, Winding
from models.drives.drive import Drive
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.drives.vibro import RatedVibro, Stop, Vibro, VoltageVibro
from models.files.rig import Rig
from models.surfaces.gut import Wall
from models.surfaces.plate import Plate
from models.surfaces.surface import Surface

KINDS = ("pull", "magnetic", "coil", "vibro")


def surface_of(rig: Rig) -> Surface:
    """What the body lies on: the gut, or the plate of `[surface]`."""
    if rig.surface is not None and rig.surface.kind == "plate" and rig.surface.friction_coefficient is not None:
        return Plate(rig.capsule.mass_kg, rig.surface.friction_coefficient)
    return Wall.around(rig.capsule, rig.tissue)


def drive_of(rig: Rig, driven: str = "") -> Drive:
    """The drive of a time-series rig; `driven` is the record's driven column, which for coil and vibro may be
    `coil_voltage_V`.

    Raises ValueError for another kind of rig, and for a voltage where the rig file lacks what it takes to turn it into
    a force.
    """
    by_voltage = driven == "coil_voltage_V"
    if rig.kind == "pull":
        return Pull()
    if rig.kind == "magnetic" and rig.magnet is not None:
        return Magnetic(rig.magnet.magnet_stiffness_N_per_m, rig.magnet.magnet_range_m)
    if rig.kind == "coil" and rig.coil is not None:
        return _coil(rig, by_voltage)
    if rig.kind == "vibro" and rig.drive is not None:
        return _vibro(rig, by_voltage)
    raise ValueError(
        f"rig must be of a kind that gives time series of a capsule; got {rig.kind!r}; known: {', '.join(KINDS)}"
    )


def _coil(rig: Rig, by_voltage: bool) -> Coil:
    c = rig.coil
    assert c is not None
    if not by_voltage:
        return Coil(c.force_constant_N_per_A, c.coil_position_m, c.coil_range_m)
    if c.coil_resistance_Ohm is None:
        raise ValueError(
            "[rig] must have the key 'coil_resistance_Ohm' where the coil is driven by a voltage; it is missing"
        )
    winding = _winding(c.coil_resistance_Ohm, c.coil_inductance_H, c.current_limit_A, c.force_constant_N_per_A)
    return VoltageCoil(c.force_constant_N_per_A, c.coil_position_m, c.coil_range_m, winding)


def _winding(resistance: float, inductance: float | None, limit: float | None, force_constant: float) -> Winding:
    """A coil whose back-EMF per speed is its force per current, as power demands."""
    return Winding(resistance, inductance or 0.0, float("inf") if limit is None else limit, force_constant)


def _vibro(rig: Rig, by_voltage: bool) -> Vibro:
    d = rig.drive
    assert d is not None
    stiff = d.stop_stiffness_N_per_m
    front, rear = (
        None if gap is None or stiff is None else Stop(gap, stiff) for gap in (d.front_stop_gap_m, d.rear_stop_gap_m)
    )
    numbers = (
        d.inner_mass_kg,
        d.spring_stiffness_N_per_m,
        d.spring_damping_N_s_per_m,
        d.force_N,
        d.reaction_on_body,
        front,
        rear,
    )
    if not by_voltage:
        return Vibro(*numbers)
    if d.rated_voltage_V is not None:
        return RatedVibro(*numbers, d.rated_voltage_V)
    if d.coil_resistance_Ohm is None or d.force_constant_N_per_A is None:
        raise ValueError(
            "[drive] must have the key 'rated_voltage_V', or 'force_constant_N_per_A' and 'coil_resistance_Ohm', where"
            " the coil is driven by a voltage; they are missing"
        )
    winding = _winding(d.coil_resistance_Ohm, d.coil_inductance_H, d.current_limit_A, d.force_constant_N_per_A)
    return VoltageVibro(*numbers, d.force_constant_N_per_A, winding)
