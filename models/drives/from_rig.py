"""From a rig file to the surface and the drive that `models.assembly.model.assemble` takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeVar

from models.drives.coil import Coil, VoltageCoil, Winding
from models.drives.drive import Drive
from models.drives.magnet_pair import MagnetPair
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.drives.vibro import RatedVibro, Stop, Vibro, VoltageVibro
from models.files.rig import Rig
from models.surfaces.air import Air
from models.surfaces.gut import Wall
from models.surfaces.plate import Plate
from models.surfaces.surface import Surface

T = TypeVar("T")


def surface_of(rig: Rig) -> Surface:
    """What the body lies on, as `[surface]` says; the gut where it says nothing."""
    kind = "gut" if rig.surface is None else rig.surface.kind
    return SURFACES[kind](rig)


def drive_of(rig: Rig, driven: str = "") -> Drive:
    """The drive of a time-series rig; `driven` is the record's driven column, which for coil and vibro may be
    `coil_voltage_V`.

    Raises ValueError for another kind of rig, and for a voltage where the rig file lacks what it takes to turn it into
    a force.
    """
    if rig.kind not in DRIVES:
        raise ValueError(
            f"rig must be of a kind that gives time series of a capsule; got {rig.kind!r}; known: {', '.join(DRIVES)}"
        )
    return DRIVES[rig.kind](rig, driven == "coil_voltage_V")


def _gut(rig: Rig) -> Surface:
    return Wall.around(rig.capsule, rig.tissue)


def _plate(rig: Rig) -> Surface:
    friction = None if rig.surface is None else rig.surface.friction_coefficient
    return Plate(rig.capsule.mass_kg) if friction is None else Plate(rig.capsule.mass_kg, friction)


def _magnetic(rig: Rig, by_voltage: bool) -> Drive:
    magnet = _there(rig.magnet, rig)
    k, r, both = magnet.magnet_stiffness_N_per_m, magnet.magnet_range_m, rig.magnets
    if both is None:
        return Magnetic(k, r)
    return MagnetPair(k, r, both.height_m, both.moments)


def _there(table: T | None, rig: Rig) -> T:
    """A table that the rig's kind has; ValueError where a rig that was put together by hand lacks it."""
    if table is None:
        raise ValueError(f"rig of kind {rig.kind!r} must have the numbers of its drive; got none")
    return table


def _coil(rig: Rig, by_voltage: bool) -> Coil:
    c = _there(rig.coil, rig)
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
    d = _there(rig.drive, rig)
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


SURFACES: Final[dict[str, Callable[[Rig], Surface]]] = {
    "gut": _gut,
    "plate": _plate,
    "air": lambda rig: Air(rig.capsule.mass_kg),
}
"""The surfaces, by `kind` of `[surface]`."""
DRIVES: Final[dict[str, Callable[[Rig, bool], Drive]]] = {
    "pull": lambda rig, by_voltage: Pull(),
    "magnetic": _magnetic,
    "coil": _coil,
    "vibro": _vibro,
}
"""The drives, by `kind` of `[rig]`; the flag says that a record logs the coil's voltage."""
