"""The tables of a rig file with the range of every key: what an experimenter may state about a rig."""

from __future__ import annotations

import typing
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel, ConfigDict, Field

from models.files.units import unit_of
from models.laws.dipole import Cylinder, Orientation, moment_A_m2, stiffness_N_per_m
from models.laws.geometry import Capsule, Regime, Tissue

Positive = Annotated[float, Field(ge=1e-12, lt=1e9)]
NotNegative = Annotated[float, Field(ge=0, lt=1e9)]
Length = Annotated[float, Field(ge=1e-6, le=10)]
Height = Annotated[float, Field(ge=1e-3, le=10)]
Mass = Annotated[float, Field(ge=1e-6, le=1000)]
RecoveryTime = Annotated[float, Field(ge=1e-4, le=100)]
CapsuleMass = Annotated[float, Field(ge=1e-5, le=0.5)]
Friction = Annotated[float, Field(ge=0, le=10)]
Angle = Annotated[float, Field(ge=1, le=89)]
Remanence = Annotated[float, Field(ge=1e-3, le=3)]
Real = Annotated[float, Field(gt=-1e9, lt=1e9)]


class Table(BaseModel):
    """A table of the file: unknown keys are refused, numbers must be finite and of their own type."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Noise(Table):
    """Standard deviations of the measurement, where known; what is left out is estimated from the record."""

    position_std_m: Annotated[float, Field(ge=1e-9, le=0.1)] | None = None
    force_std_N: Annotated[float, Field(ge=1e-9, le=100)] | None = None
    angle_std_rad: Annotated[float, Field(ge=1e-9, le=10)] | None = None
    torque_std_N_m: Annotated[float, Field(ge=1e-9, le=1e4)] | None = None
    velocity_std_m_s: Annotated[float, Field(ge=1e-9, le=10)] | None = None
    period_std_s: Annotated[float, Field(ge=1e-9, le=100)] | None = None
    modulus_std_Pa: Positive | None = None


class Checks(Table):
    """What is known of the records of this rig: findings of `capsule check` that no longer stop a fit, by id."""

    accept: list[str] = []


MOST_DRIFT = 0.1
"""The largest `[clock] drift`, in seconds a second."""


class Clock(Table):
    """Two clocks: how much later than the driven columns the measured ones are stamped, in s (negative: earlier), and
    the standard deviation with which that is known: a calibration looks for it within four of these. With `drift` they
    come later by so many seconds in each second of a record, where the drive is a place.
    """

    offset_s: Annotated[float, Field(ge=-0.5, le=0.5)] = 0.0
    offset_std_s: Annotated[float, Field(ge=1e-9, le=0.2)] = 1e-3
    drift: Annotated[float, Field(ge=-MOST_DRIFT, le=MOST_DRIFT)] = 0.0


class ColumnTable(Table):
    """One key of `[columns]`: which column of a file is this column of ours, `sign * scale * (column - offset)` in
    `unit`, its numbers beginning again after `wrap`.
    """

    column: Annotated[str, Field(min_length=1)]
    unit: str | None = None
    sign: Literal[1, -1] = 1
    offset: Annotated[float, Field(gt=-1e15, lt=1e15)] = 0.0
    scale: Positive | None = None
    wrap: Positive | None = None


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
    """What the body lies on: a rigid plate with Coulomb friction, the gut of `[tissue]`, or nothing (in the air)."""

    kind: Literal["plate", "gut", "air"]
    friction_coefficient: Friction | None = None


class Magnet(Table):
    """The magnet's force `k g/(1 + (g/r)^2)^2` on the gap g = carriage - capsule."""

    magnet_stiffness_N_per_m: Positive
    magnet_range_m: Length


class Magnets(Table):
    """`[rig.magnet]`: the magnet on the carriage (outer) and the capsule's (inner), each by its moment or by size and
    remanence of a cylinder that is magnetised along its axis, and the height across the lumen between their centres.

    Moments lie `across` the lumen, towards each other, or `along` it, opposite. `height_range_m` is where the carriage
    may lift the magnet to, `pressing_limit_N` the most that it may then press the capsule on the tissue.
    """

    height_m: Height
    moments: Orientation = "across"
    outer_moment_A_m2: Positive | None = None
    outer_diameter_m: Length | None = None
    outer_length_m: Length | None = None
    outer_remanence_T: Remanence | None = None
    inner_moment_A_m2: Positive | None = None
    inner_diameter_m: Length | None = None
    inner_length_m: Length | None = None
    inner_remanence_T: Remanence | None = None
    height_range_m: Annotated[list[Height], Field(min_length=2, max_length=2)] | None = None
    pressing_limit_N: Positive | None = None

    def moment(self, side: Literal["outer", "inner"]) -> float:
        """The moment of one magnet in A m^2. Raises ValueError where it is stated neither way or both."""
        moment = getattr(self, f"{side}_moment_A_m2")
        names = [f"{side}_{name}" for name in ("remanence_T", "diameter_m", "length_m")]
        size = [getattr(self, name) for name in names]
        given = [name for name, value in zip(names, size, strict=True) if value is not None]
        if moment is not None and not given:
            return float(moment)
        if moment is None and len(given) == len(names):
            return moment_A_m2(*size)
        raise ValueError(
            f"[rig.magnet] must have {side}_moment_A_m2, or {', '.join(names)}, and not both; got"
            f" {', '.join([f'{side}_moment_A_m2'] * (moment is not None) + given) or 'neither'}"
        )

    def cylinders(self) -> tuple[Cylinder, Cylinder] | None:
        """Both magnets' sizes; None where one is only known by its moment."""
        sizes = (self.outer_diameter_m, self.outer_length_m, self.inner_diameter_m, self.inner_length_m)
        if any(size is None for size in sizes):
            return None
        return Cylinder(*sizes[:2]), Cylinder(*sizes[2:])  # type: ignore[arg-type]

    def stiffness_N_per_m(self) -> float:
        """Stiffness of the pull at `height_m`."""
        return stiffness_N_per_m(self.moment("outer") * self.moment("inner"), self.height_m, self.moments)

    def check(self) -> None:
        """Raises ValueError of one sentence for numbers that do not go together."""
        self.stiffness_N_per_m()
        if self.height_range_m is not None:
            low, high = self.height_range_m
            if not low <= self.height_m <= high:
                raise ValueError(
                    f"[rig.magnet] height_range_m must be the lowest and the highest height, with height_m ="
                    f" {self.height_m:g} between; got [{low:g}, {high:g}]"
                )
            if self.pressing_limit_N is None:
                raise ValueError(
                    "[rig.magnet] must have the key 'pressing_limit_N', the most that the magnet may press on the"
                    " tissue, where height_range_m lets the height be commanded; it is missing"
                )


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
    """Nominal numbers of a linear stage, `F = M a + F_v v + F_c sgn(v) + offset`, or those of one that turns; all may
    be left out.
    """

    mass_kg: Mass | None = None
    viscous_friction_N_s_per_m: NotNegative | None = None
    coulomb_friction_N: NotNegative | None = None
    offset_N: Real | None = None
    inertia_kg_m2: Positive | None = None
    viscous_friction_N_m_s_per_rad: NotNegative | None = None
    coulomb_friction_N_m: NotNegative | None = None
    offset_N_m: Real | None = None


class Contact(Table):
    """Nominal numbers of a steady contact: the coefficient of friction, or the friction force where no load is known,
    and the load where no column has it; all may be left out.
    """

    friction_coefficient: NotNegative | None = None
    friction_N: NotNegative | None = None
    load_N: Positive | None = None


class CapsuleTable(Table):
    """`[capsule]` of a capsule in the gut."""

    radius_m: Annotated[float, Field(ge=1e-4, le=0.1)]
    cylinder_length_m: Annotated[float, Field(ge=0, le=0.5)]
    mass_kg: CapsuleMass

    def capsule(self) -> Capsule:
        """The laws' record of it."""
        return Capsule(**self.model_dump())


class BodyTable(CapsuleTable):
    """`[capsule]` of a body on a plate, whose shape does not matter."""

    radius_m: Annotated[float, Field(ge=1e-4, le=0.1)] = Capsule.radius_m
    cylinder_length_m: Annotated[float, Field(ge=0, le=0.5)] = Capsule.cylinder_length_m
    mass_kg: Mass


class PaperCapsuleTable(BodyTable):
    """`[capsule]` of paper A where nothing else is said."""

    mass_kg: Mass = Capsule.mass_kg


class TissueTable(Table):
    """`[tissue]`: `preset` names the wall's constants, the other keys describe this piece of gut. `lumen_diameter_m`
    may stand for `contact_angle_deg` (`with_contact_angle`).
    """

    preset: Literal["jejunum"]
    wall_thickness_m: Annotated[float, Field(ge=1e-5, le=0.05)]
    contact_angle_deg: Angle
    lumen_diameter_m: Length | None = None
    nose_force_angle_deg: Angle
    friction_coefficient: Friction
    mucus_thickness_m: Annotated[float, Field(ge=1e-7, le=0.01)]
    recovery_time_s: RecoveryTime
    regime: Regime = "low"

    def tissue(self) -> Tissue:
        """The laws' record of it."""
        return Tissue(**self.model_dump(exclude={"preset", "lumen_diameter_m"}))


class PaperTissueTable(TissueTable):
    """`[tissue]` of paper A where nothing else is said."""

    preset: Literal["jejunum"] = "jejunum"
    wall_thickness_m: Annotated[float, Field(ge=1e-5, le=0.05)] = Tissue.wall_thickness_m
    contact_angle_deg: Angle = Tissue.contact_angle_deg
    nose_force_angle_deg: Angle = Tissue.nose_force_angle_deg
    friction_coefficient: Friction = Tissue.friction_coefficient
    mucus_thickness_m: Annotated[float, Field(ge=1e-7, le=0.01)] = Tissue.mucus_thickness_m
    recovery_time_s: RecoveryTime = Tissue.recovery_time_s


EXAMPLES: Final[Mapping[str, str]] = {
    "radius_m": "6.5e-3",
    "cylinder_length_m": "20e-3",
    "mass_kg": "4.0e-3",
    "preset": '"jejunum"',
    "wall_thickness_m": "2.5e-3",
    "contact_angle_deg": "60.0",
    "nose_force_angle_deg": "30.0",
    "friction_coefficient": "0.082",
    "mucus_thickness_m": "30e-6",
    "recovery_time_s": "0.05",
    "magnet_stiffness_N_per_m": "25.0",
    "magnet_range_m": "0.02",
    "height_m": "0.15",
    "force_constant_N_per_A": "0.5",
    "inner_mass_kg": "0.074",
    "spring_stiffness_N_per_m": "256.0",
    "force_N": "1.25",
    "reaction_on_body": "true",
    "kind": '"plate"',
    "column": '"Load [mN]"',
}
"""A value of each key that a table must have, as TOML writes it."""


def bounds(table: type[Table], key: str) -> tuple[Ge | Gt | None, Le | Lt | None]:
    """The lower and the upper bound of a key's numbers; None where there is none."""
    found = [*table.model_fields[key].metadata, *_within(table.model_fields[key].annotation)]
    lower = next((one for one in found if isinstance(one, Ge | Gt)), None)
    return lower, next((one for one in found if isinstance(one, Le | Lt)), None)


def _within(hint: Any) -> Iterator[Any]:
    """The marks of a hint and of all that is in it."""
    for mark in getattr(hint, "__metadata__", ()):
        yield from getattr(mark, "metadata", (mark,))
    for part in typing.get_args(hint):
        yield from _within(part)


def range_words(table: type[Table], key: str) -> str:
    """The range of a key in words, with the unit that ends its name; empty where it has none."""
    lower, upper = bounds(table, key)
    unit = f" {unit_of(key).replace('_per_', '/')}" if unit_of(key) else ""
    if isinstance(lower, Ge) and isinstance(upper, Le):
        return f"{lower.ge:g} to {upper.le:g}{unit}"
    low = lower and (f"at least {lower.ge:g}" if isinstance(lower, Ge) else f"more than {lower.gt:g}")
    high = upper and (f"at most {upper.le:g}" if isinstance(upper, Le) else f"less than {upper.lt:g}")
    return " and ".join(word for word in (low, high) if word) + (unit if low or high else "")


def check_range(table: type[Table], key: str, value: float, where: str) -> None:
    """Refuse a number out of the range that a rig file's `table` gives its `key`. Raises ValueError of one sentence."""
    lower, upper = bounds(table, key)
    low = lower is None or (value >= lower.ge if isinstance(lower, Ge) else value > lower.gt)  # type: ignore[operator]
    high = upper is None or (value <= upper.le if isinstance(upper, Le) else value < upper.lt)  # type: ignore[operator]
    if not (low and high):
        raise ValueError(f"{where}.{key} must be {range_words(table, key)}; got {value:g}")
