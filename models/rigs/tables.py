"""The tables of a rig file with the range of every key: what an experimenter may state about a rig."""

from collections.abc import Collection, Sequence
from dataclasses import asdict
from typing import Annotated, Literal

from pydantic import Field

from models.laws.geometry import Capsule, Regime, Tissue
from models.rigs.schema import (
    Angle,
    CapsuleMass,
    Friction,
    Length,
    Mass,
    NotNegative,
    Positive,
    Real,
    RecoveryTime,
    Table,
    assuming,
    key,
)


class Noise(Table):
    """Standard deviations of the measurement; one that is left out is estimated from the record."""

    position_std_m: Annotated[float, Field(ge=1e-9, le=0.1)] | None = key(
        "standard deviation of the position measurement; left out: estimated from the record", None
    )
    force_std_N: Annotated[float, Field(ge=1e-9, le=100)] | None = key(
        "standard deviation of the force measurement; left out: estimated", None
    )
    angle_std_rad: Annotated[float, Field(ge=1e-9, le=10)] | None = key(
        "standard deviation of the angle of an axis that turns; left out: estimated from the record", None
    )
    torque_std_N_m: Annotated[float, Field(ge=1e-9, le=1e4)] | None = key(
        "standard deviation of its torque; left out: estimated", None
    )
    force_scale_std: Annotated[float, Field(ge=0, le=0.5)] | None = key(
        "relative standard deviation of the scale of a force or torque from which an axis is run (a motor's constant);"
        " left out: 0.05, as data sheets state 10 % at most",
        None,
    )
    acceleration_std_m_s2: Annotated[float, Field(ge=1e-6, le=1e4)] | None = key(
        "standard deviation of an accelerometer on the capsule; left out: estimated", None
    )
    drive_force_std_N: Positive | None = key("the same of a load cell between drive and capsule", None)
    load_position_std_m: Positive | None = key("the same of an encoder at the load of an axis", None)
    load_angle_std_rad: Positive | None = key("the same where it turns", None)
    velocity_std_m_s: Annotated[float, Field(ge=1e-9, le=10)] | None = key(
        "standard deviation of a mean speed between set-ups, which repeats do not show; left out: 0.002", None
    )
    period_std_s: Annotated[float, Field(ge=1e-9, le=100)] | None = key(
        "standard deviation of a period; left out: estimated", None
    )
    modulus_std_Pa: Positive | None = key("standard deviation of a modulus; left out: estimated", None)


class ChecksTable(Table):
    """Findings of `capsule check` that no longer stop a fit, by id."""

    accept: list[str] = key(
        "findings of `capsule check`, by id, that no longer stop a fit; they weaken its verdict",
        [],
    )


MOST_DRIFT = 0.1
"""The largest `[clock] drift`, in seconds a second."""


class ClockTable(Table):
    """Two clocks: how much later than the driven columns the measured ones are stamped, in s (negative: earlier), and
    the standard deviation with which that is known: a calibration looks for it within four of these. With `drift` they
    come later by so many seconds in each second of a record, where the drive is a position.
    """

    purpose = "how late the measured columns are stamped"
    offset_s: Annotated[float, Field(ge=-0.5, le=0.5)] = key(
        "how much later than the driven columns the measured ones are stamped; negative: earlier", 0.0
    )
    offset_std_s: Annotated[float, Field(ge=1e-9, le=0.2)] = key(
        "how well that is known: a calibration looks for it within four of these", 1e-3
    )
    acceleration_offset_s: Annotated[float, Field(ge=-0.5, le=0.5)] = key(
        "the same of an accelerometer, for which a calibration looks within 20 ms", 0.0
    )
    drive_force_offset_s: Annotated[float, Field(ge=-0.5, le=0.5)] = key("the same of a load cell", 0.0)
    drift: Annotated[float, Field(ge=-MOST_DRIFT, le=MOST_DRIFT)] = key(
        "growth of that offset per second of a record, s/s; removed before any fit where the drive is a"
        " position (pull, magnetic)",
        0.0,
    )


class ColumnTable(Table):
    """One key of `[columns]`: the column of a file that is ours, `sign * scale * (column - offset)` in `unit`; its
    numbers begin again after `wrap`.
    """

    column: str = key("name of the column in the files, exactly as it stands there", "", example='"Load [mN]"')
    rate_Hz: Positive | None = key("in place of a column of times: the rate at which all others were sampled", None)
    unit: str | None = key(
        "unit of that column, such as `mm`, `gf`, `ms`; left out: the one that the file states or that the column's"
        " name ends in, else that of our column",
        None,
    )
    sign: Literal[1, -1] = key("-1 reverses the column's direction", 1)
    offset: Annotated[float, Field(gt=-1e15, lt=1e15)] = key(
        "what the column shows at zero, in its own unit: `sign * (column - offset)` is converted to our unit", 0.0
    )
    scale: Positive | None = key(
        "what one of the file's numbers (a volt, a count, a pixel) is in `unit`; left out: the file's unit says it",
        None,
    )
    wrap: Positive | None = key(
        "after how much its numbers begin again, in its own unit: 360 of an angle in degrees, 65536 of a counter;"
        " jumps of more than half of it are undone",
        None,
    )


class DriveTable(Table):
    """The inner mass of a vibro-impact drive: on a spring to the body, pushed by `force_N` while the coil is on.

    `reaction_on_body` false: an external field acts on the inner mass alone. A stop that is left out is out of reach.
    Where a record logs the coil's voltage, either `rated_voltage_V` gives `force_N` at once, or
    `force_constant_N_per_A` and `coil_resistance_Ohm` (with inductance and the supply's limit, where they matter) turn
    it into a current and that into a force.
    """

    inner_mass_kg: Mass = key("mass of the inner mass", example="0.074")
    spring_stiffness_N_per_m: NotNegative = key("stiffness of its spring to the body", example="256.0")
    force_N: Real = key("the coil's force while it is on", example="1.25")
    reaction_on_body: bool = key(
        "true: the coil sits in the body; false: an outside field acts on the inner mass alone", example="true"
    )
    spring_damping_N_s_per_m: NotNegative = key("damping of the spring", 0.0)
    front_stop_gap_m: Positive | None = key("distance to the front stop; left out: out of reach", None)
    rear_stop_gap_m: Positive | None = key("distance to the rear stop; left out: out of reach", None)
    stop_stiffness_N_per_m: Positive | None = key("stiffness of the stops", None)
    rated_voltage_V: Positive | None = key("voltage at which the coil gives `force_N`", None)
    force_constant_N_per_A: Real | None = key("force per ampere of coil current", None)
    coil_resistance_Ohm: Positive | None = key("resistance of the coil, where a record has its voltage", None)
    coil_inductance_H: Positive | None = key("inductance of the coil", None)
    current_limit_A: Positive | None = key("most current that the supply gives", None)


class SurfaceTable(Table):
    """What the body lies on: a rigid plate with Coulomb friction, the gut of `[tissue]`, or nothing (in the air)."""

    purpose = "a plate under the capsule, or nothing but air, in place of the gut"
    kind: Literal["plate", "gut", "air"] = key(
        "`plate` is rigid with Coulomb friction; `gut` needs `[tissue]`; in the `air` nothing holds the body",
        example='"plate"',
    )
    friction_coefficient: Friction | None = key("coefficient of Coulomb friction; required for a plate", None)

    def check(self) -> None:
        if self.kind == "plate" and self.friction_coefficient is None:
            raise ValueError(
                "[surface] must have the key 'friction_coefficient' where its kind is 'plate'; it is missing"
            )


class CoilTable(Table):
    """The coil's force `k_c i` on the capsule, falling with the distance from the coil where a range is
    given.
    """

    force_constant_N_per_A: Real = key("force per ampere of coil current", example="0.5")
    coil_position_m: Real = key("position of the coil", 0.0)
    coil_range_m: Length | None = key(
        "range over which the coil's force falls; left out: the same force everywhere", None
    )
    coil_resistance_Ohm: Positive | None = key("resistance of the coil, where a record has its voltage", None)
    coil_inductance_H: Positive | None = key("inductance of the coil", None)
    current_limit_A: Positive | None = key("most current that the supply gives", None)


class Axis(Table):
    """Nominal numbers of a linear stage, `F = M a + F_v v + F_c sgn(v) + offset`, or those of one that turns; all may
    be left out.
    """

    mass_kg: Mass | None = key(
        "mass of the capsule, of a vibro drive's body without the inner mass, of the moving part of an axis", None
    )
    viscous_friction_N_s_per_m: NotNegative | None = key("nominal viscous friction", None)
    coulomb_friction_N: NotNegative | None = key("nominal Coulomb friction", None)
    offset_N: Real | None = key("nominal constant force", None)
    inertia_kg_m2: Positive | None = key("moment of inertia of an axis that turns", None)
    viscous_friction_N_m_s_per_rad: NotNegative | None = key("its nominal viscous friction", None)
    coulomb_friction_N_m: NotNegative | None = key("its nominal Coulomb friction", None)
    offset_N_m: Real | None = key("its nominal constant torque", None)
    force_constant_N_per_A: Real | None = key("force per ampere, where a current drives it", None)
    force_constant_N_per_V: Real | None = key("force per volt, where an amplifier's command drives it", None)
    torque_constant_N_m_per_A: Real | None = key("torque per ampere of one that turns", None)
    torque_constant_N_m_per_V: Real | None = key("its torque per volt", None)

    @classmethod
    def of(cls, columns: Collection[str]) -> Sequence[str]:
        keys = list(cls.model_fields)
        return (*keys[4:8], *keys[10:]) if "angle_rad" in columns else (*keys[:4], *keys[8:10])

    def constant(self, driven: str) -> float | None:
        """Force in N (torque in N m) of 1 in the `driven` column; None where records must show it, by the inertia that
        is stated. Raises ValueError where neither is.
        """
        if driven in ("", "force_N", "torque_N_m"):
            return 1.0
        unit = driven.rpartition("_")[2]
        keys = [name for name in type(self).model_fields if name.endswith(f"_per_{unit}")]
        stated = [value for name in keys if (value := getattr(self, name)) is not None]
        if not stated and (self.mass_kg or self.inertia_kg_m2):
            return None
        if len(stated) != 1:
            raise ValueError(
                f"[axis] must have one of {' and '.join(keys)}, or else mass_kg or inertia_kg_m2, where {driven}"
                f" drives: records show only the ratio of the constant to the inertia; got {len(stated) or 'neither'}"
            )
        return float(stated[0])


class Contact(Table):
    """Nominal numbers of a steady contact: the coefficient of friction, or the friction force where no load is known,
    and the load where no column has it; all may be left out.
    """

    friction_coefficient: NotNegative | None = key("coefficient of Coulomb friction; required for a plate", None)
    friction_N: NotNegative | None = key("nominal friction force of a contact whose load is not known", None)
    load_N: Positive | None = key("load on the contact where no column has it", None)


class CapsuleTable(Table):
    """`[capsule]` of a capsule in the gut."""

    radius_m: Annotated[float, Field(ge=1e-4, le=0.1)] = key("radius of the capsule", example="6.5e-3")
    cylinder_length_m: Annotated[float, Field(ge=0, le=0.5)] = key(
        "length of its cylindrical part, without the round ends", example="20e-3"
    )
    mass_kg: CapsuleMass = key(
        "mass of the capsule, of a vibro drive's body without the inner mass, of the moving part of an axis",
        example="4.0e-3",
    )

    def capsule(self) -> Capsule:
        """The laws' record of it."""
        return Capsule(**self.model_dump())


_CAPSULE = asdict(Capsule())
_SHAPE = {key: _CAPSULE[key] for key in ("radius_m", "cylinder_length_m")}
BodyTable = assuming("BodyTable", CapsuleTable, _SHAPE, mass_kg=Mass)
"""`[capsule]` of a body on a plate, whose shape does not matter."""
PaperCapsuleTable = assuming("PaperCapsuleTable", BodyTable, _CAPSULE)
"""`[capsule]` of paper A where nothing else is stated."""


class TissueTable(Table):
    """`[tissue]`: `preset` names the wall's constants, the other keys describe this piece of gut. `lumen_diameter_m`
    may stand for `contact_angle_deg` (`with_contact_angle`).
    """

    preset: Literal["jejunum"] = key("set of constants of the wall", example='"jejunum"')
    wall_thickness_m: Annotated[float, Field(ge=1e-5, le=0.05)] = key("thickness of the gut's wall", example="2.5e-3")
    contact_angle_deg: Angle = key(
        "angle at which the wall meets the capsule's nose; its cosine is the diameter of the relaxed lumen over"
        " that of the capsule",
        example="60.0",
    )
    lumen_diameter_m: Length | None = key(
        "inner diameter of the relaxed lumen, less than the capsule's; may replace `contact_angle_deg`", None
    )
    nose_force_angle_deg: Angle = key("direction of the wall's force on the nose", example="30.0")
    friction_coefficient: Friction = key("coefficient of Coulomb friction; required for a plate", example="0.082")
    mucus_thickness_m: Annotated[float, Field(ge=1e-7, le=0.01)] = key("thickness of the mucus film", example="30e-6")
    recovery_time_s: RecoveryTime = key("time in which a wall that slipped draws back", example="0.05")
    regime: Regime = key(
        "moduli of the wall: `low` those measured below 20 mm/s, `high` those above, `blend` each where it was"
        " measured; for speeds above 20 mm/s take `blend`",
        "low",
    )

    def tissue(self) -> Tissue:
        """The laws' record of it."""
        return Tissue(**self.model_dump(exclude={"preset", "lumen_diameter_m"}))


PaperTissueTable = assuming("PaperTissueTable", TissueTable, {"preset": "jejunum"} | asdict(Tissue()))
"""`[tissue]` of paper A where nothing else is stated."""
