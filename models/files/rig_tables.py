"""The tables of a rig file with the range of every key: what an experimenter may state about a rig."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from models.laws.geometry import Capsule, Tissue

Positive = Annotated[float, Field(gt=0, lt=1e9)]
NotNegative = Annotated[float, Field(ge=0, lt=1e9)]
Length = Annotated[float, Field(gt=0, le=10)]
Mass = Annotated[float, Field(gt=0, le=1000)]
Friction = Annotated[float, Field(ge=0, le=10)]
Real = Annotated[float, Field(gt=-1e9, lt=1e9)]


class Table(BaseModel):
    """A table of the file: unknown keys are refused, numbers must be finite and of their own type."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Noise(Table):
    """Standard deviations of the measurement, where known; what is left out is estimated from the record."""

    position_std_m: Positive | None = None
    force_std_N: Positive | None = None
    velocity_std_m_s: Positive | None = None
    period_std_s: Positive | None = None
    modulus_std_Pa: Positive | None = None


class Checks(Table):
    """What is known of the records of this rig: findings of `capsule check` that no longer stop a fit, by id."""

    accept: list[str] = []


class Clock(Table):
    """Two clocks: how much later than the driven columns the measured ones are stamped, in s (negative: earlier), and
    the standard deviation with which that is known; 0 where it is known exactly, else a calibration looks for it.
    """

    offset_s: Annotated[float, Field(ge=-0.5, le=0.5)] = 0.0
    offset_std_s: Annotated[float, Field(ge=0, le=0.2)] = 0.0


class ColumnTable(Table):
    """One key of `[columns]`: which column of a file is this column of ours, `sign * (column - offset)` in `unit`."""

    column: Annotated[str, Field(min_length=1)]
    unit: str | None = None
    sign: Literal[1, -1] = 1
    offset: Annotated[float, Field(gt=-1e15, lt=1e15)] = 0.0


class Drive(Table):
    """The inner mass of a vibro-impact drive: on a spring to the body, pushed by `force_N` while the coil is on.

    `reaction_on_body` false: an external field acts on the inner mass alone. A stop that is left out is out of reach.
    Where a record logs the coil's voltage, either `rated_voltage_V` gives `force_N` at once, or
    `force_constant_N_per_A` and `coil_resistance_Ohm` (with inductance and the supply's limit, where they matter) turn
    it into a current and that into a force.
    """

    inner_mass_kg: Mass
    spring_stiffness_N_per_m: NotNegative
    force_N: Real
    reaction_on_body: bool
    spring_damping_N_s_per_m: NotNegative = 0.0
    front_stop_gap_m: Positive | None = None
    rear_stop_gap_m: Positive | None = None
    stop_stiffness_N_per_m: Positive | None = None
    rated_voltage_V: Positive | None = None
    force_constant_N_per_A: Real | None = None
    coil_resistance_Ohm: Positive | None = None
    coil_inductance_H: Positive | None = None
    current_limit_A: Positive | None = None


class Surface(Table):
    """What the body of a vibro-impact drive lies on: a rigid plate with Coulomb friction, or the gut of `[tissue]`."""

    kind: Literal["plate", "gut"]
    friction_coefficient: Friction | None = None


class Magnet(Table):
    """The magnet's force `k g/(1 + (g/r)^2)^2` on the gap g = carriage - capsule."""

    magnet_stiffness_N_per_m: Positive
    magnet_range_m: Length


class Coil(Table):
    """The coil's force `k_c i` on the capsule, falling with the distance from the coil's place where a range is
    given.
    """

    force_constant_N_per_A: Real
    coil_position_m: Real = 0.0
    coil_range_m: Length | None = None
    coil_resistance_Ohm: Positive | None = None
    coil_inductance_H: Positive | None = None
    current_limit_A: Positive | None = None


class Axis(Table):
    """Nominal numbers of a linear stage, `F = M a + F_v v + F_c sgn(v) + offset`; all may be left out."""

    mass_kg: Mass | None = None
    viscous_friction_N_s_per_m: NotNegative | None = None
    coulomb_friction_N: NotNegative | None = None
    offset_N: Real | None = None


class CapsuleTable(Table):
    """`[capsule]` of a capsule in the gut."""

    radius_m: Annotated[float, Field(ge=1e-4, le=0.1)]
    cylinder_length_m: Annotated[float, Field(ge=0, le=0.5)]
    mass_kg: Mass

    def capsule(self) -> Capsule:
        """The laws' record of it."""
        return Capsule(**self.model_dump())


class BodyTable(CapsuleTable):
    """`[capsule]` of a body on a plate, whose shape does not matter."""

    radius_m: Annotated[float, Field(ge=1e-4, le=0.1)] = Capsule.radius_m
    cylinder_length_m: Annotated[float, Field(ge=0, le=0.5)] = Capsule.cylinder_length_m


class PaperCapsuleTable(BodyTable):
    """`[capsule]` of paper A where nothing else is said."""

    mass_kg: Mass = Capsule.mass_kg


class TissueTable(Table):
    """`[tissue]`: `preset` names the wall's constants, the other keys describe this piece of gut."""

    preset: Literal["jejunum"]
    wall_thickness_m: Annotated[float, Field(ge=1e-5, le=0.05)]
    contact_angle_deg: Annotated[float, Field(gt=0, lt=90)]
    nose_force_angle_deg: Annotated[float, Field(gt=0, lt=90)]
    friction_coefficient: Friction
    mucus_thickness_m: Annotated[float, Field(ge=1e-7, le=0.01)]
    recovery_time_s: Annotated[float, Field(gt=0, le=100)]

    def tissue(self) -> Tissue:
        """The laws' record of it."""
        return Tissue(**self.model_dump(exclude={"preset"}))


class PaperTissueTable(TissueTable):
    """`[tissue]` of paper A where nothing else is said."""

    preset: Literal["jejunum"] = "jejunum"
    wall_thickness_m: Annotated[float, Field(ge=1e-5, le=0.05)] = Tissue.wall_thickness_m
    contact_angle_deg: Annotated[float, Field(gt=0, lt=90)] = Tissue.contact_angle_deg
    nose_force_angle_deg: Annotated[float, Field(gt=0, lt=90)] = Tissue.nose_force_angle_deg
    friction_coefficient: Friction = Tissue.friction_coefficient
    mucus_thickness_m: Annotated[float, Field(ge=1e-7, le=0.01)] = Tissue.mucus_thickness_m
    recovery_time_s: Annotated[float, Field(gt=0, le=100)] = Tissue.recovery_time_s
