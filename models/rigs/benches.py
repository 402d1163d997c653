"""Rigs that are no capsule in motion: a machine's axis, a contact, tables of runs or periods, a sample of the wall."""

from functools import partial
from typing import Any, Literal

import numpy as np

from models.drives.axis_force import AxisForce, AxisTorque, by
from models.rigs.capsules import VIBRO
from models.rigs.columns import LOAD_PLACES, LOADS, SLOWEST_PULL, Columns, Range
from models.rigs.kind import Record, RigKind, Tables
from models.rigs.rig import Head, Rig
from models.rigs.schema import key
from models.rigs.tables import Axis, BodyTable, Contact, DriveTable, PaperCapsuleTable, PaperTissueTable, SurfaceTable


def _axis_template(
    drive: type[AxisForce],
    sizes: tuple[float, float],
    true: tuple[float, float, float],
    nominal: tuple[float, float, float, float],
    noise: float,
    rng: np.random.Generator,
) -> tuple[Tables, Record]:
    """20 s of a slow swing and a fast one of these `sizes`, and the force (torque) of the `true` mass (inertia) and
    friction, which differ from the `nominal` ones, with `noise`.
    """
    t = np.arange(0, 20, 2e-3)
    turns, size = 2 * np.pi * np.array([[0.2], [0.5]]), np.array(sizes)[:, None]
    x = np.sum(size * (1 - np.cos(turns * t)), axis=0)
    v, a = np.sum(size * turns * np.sin(turns * t), axis=0), np.sum(size * turns**2 * np.cos(turns * t), axis=0)
    force = true[0] * a + true[1] * v + true[2] * np.sign(v) + noise * rng.standard_normal(t.size)
    tables: Tables = {"rig": {"kind": AXIS.id}, "axis": dict(zip(drive.rail.names, nominal, strict=True))}
    return tables, {"t_s": t, drive.measured: x, drive.commanded: force}


_DRIVES = ("force_N", "torque_N_m", "coil_current_A", "coil_voltage_V")


class AxisHead(Head):
    """`[rig]` of an axis with the column that drives it, where its place is measured and not imposed."""

    driven: Literal["force_N", "torque_N_m", "coil_current_A", "coil_voltage_V"] | None = key(
        "the column that drives the axis, whose place is then predicted; left out: the place is imposed, and the force"
        " or torque is measured, if the records have one",
        None,
    )

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "driven": self.driven or ""}


AXIS = RigKind(
    id="axis",
    head=AxisHead,
    layouts=(
        Columns((("position_m",),), ("force_N",), optional=("velocity_m_s", *LOADS), beside=LOAD_PLACES[:1]),
        Columns((("angle_rad",),), ("torque_N_m",), optional=("velocity_rad_s", *LOADS), beside=LOAD_PLACES[1:]),
    ),
    ranges={
        "velocity_m_s": Range(-1e3, 1e3, "between -1000 and 1000 m/s"),
        "force_N": Range(-1e6, 1e6, "between -1e6 and 1e6 N"),
    },
    tables={"axis": Axis},
    template=partial(_axis_template, AxisForce, (0.05, 0.01), (95.0, 210.0, 22.0), (100.0, 200.0, 20.0, 0.0), 0.5),
    turning_template=partial(_axis_template, AxisTorque, (0.7, 0.1), (0.38, 1.25, 2.1), (0.4, 1.2, 2.0, 0.0), 0.05),
    wanted="more records, or one of at least four stretches of motion that last more than 0.4 s each",
    stage=True,
    may_drive=_DRIVES[2:],
    hooks=frozenset({"level", "direction", "force", "measured", "delay", "advance"}),
    signals=frozenset({"t", "x", "v", "direction", "travelled", "load"}),
)
"""A linear stage, or one that turns: its position is imposed, its force or torque is measured."""


def _axis_drive(rig: Rig, by_voltage: bool = False) -> AxisForce:
    turns = rig.driven == "torque_N_m" or rig.axis.inertia_kg_m2 is not None
    drive = AxisTorque if turns else AxisForce
    return drive() if rig.axis.constant(rig.driven) is not None else by(drive, rig.driven)()


DRIVEN_AXIS = RigKind(
    id="driven_axis",
    turned=AXIS.id,
    layouts=tuple(
        Columns(((force, *_DRIVES[2:]),), (place,), optional=own.optional, beside=own.beside)
        for own, force, place in zip(AXIS.layouts, _DRIVES, ("position_m", "angle_rad"), strict=False)
    ),
    head=AxisHead,
    ranges={**AXIS.ranges, "position_m": Range(-1e4, 1e4, "between -10000 and 10000 m")},
    tables=AXIS.tables,
    drive=_axis_drive,
    surface=lambda rig: _axis_drive(rig).rail,
    wanted=AXIS.wanted,
    stage=True,
    hooks=AXIS.hooks | {"gain"},
)
"""The same axis whose force or torque is driven, and whose place is measured."""


def _friction_template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """Twelve speeds under three loads, three readings each: the Stribeck curve of a lubricated contact with scatter."""
    v, load = (np.repeat(a.ravel(), 3) for a in np.meshgrid(np.geomspace(2e-4, 2e-2, 12), (0.1, 0.2, 0.5)))
    force = 0.09 * load * (1 + 0.5 * np.exp(-v / 2e-3)) * (1 + 0.02 * rng.standard_normal(v.size))
    tables: Tables = {"rig": {"kind": FRICTION.id}, "contact": {"friction_coefficient": 0.1}}
    return tables, {"velocity_m_s": v, "load_N": load, "force_N": force}


FRICTION = RigKind(
    id="friction",
    layouts=tuple(
        Columns((("velocity_m_s",),), (measured,), time=False, minimum=4, optional=("load_N",))
        for measured in ("force_N", "friction_coefficient")
    ),
    ranges={
        "velocity_m_s": Range(-1e3, 1e3, "between -1000 and 1000 m/s and not 0", zero=False),
        "force_N": Range(-1e6, 1e6, "between -1e6 and 1e6 N"),
        "load_N": Range(0.0, 1e9, "positive, at most 1e9 N", above=True),
    },
    usual={"velocity_m_s": (0.0, 20.0, "m/s"), "friction_coefficient": (1e-4, 10.0, "as a coefficient")},
    tables={"contact": Contact},
    template=_friction_template,
    wanted="more speeds or loads",
    hooks=frozenset({"level", "force", "normal_load"}),
    signals=frozenset({"v", "direction", "load"}),
)
"""A steady contact: speed and load are driven, the friction force or its coefficient is measured."""


def _runs_template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """Runs of a capsubot on a plate at seven periods and three duties, two each."""
    surface = {"kind": "plate", "friction_coefficient": 0.29}
    tables: Tables = {"rig": {"kind": VIBRO_TABLE.id}, **VIBRO.nominal, "surface": surface}
    periods, duties = np.meshgrid(np.arange(0.05, 0.116, 0.011), (0.2, 0.5, 0.8))
    runs = {"period_s": np.repeat(periods.ravel(), 2), "duty": np.repeat(duties.ravel(), 2)}
    return tables, {**runs, "cycles": np.full(len(runs["duty"]), 20.0)}


VIBRO_TABLE = RigKind(
    id="vibro_table",
    layouts=(Columns((("period_s",), ("duty",), ("cycles",)), ("mean_velocity_m_s",), time=False, minimum=4),),
    usual={"mean_velocity_m_s": (0.0, 1.0, "m/s")},
    tables={"capsule": BodyTable, "drive": DriveTable, "surface": SurfaceTable},
    template=_runs_template,
    longest_s=1e5,
    wanted="runs at more pairs of period_s and duty",
    runs=True,
    hooks=frozenset({"suspension", "reach", "link", "gain", "modulus"}),
)
"""Runs of a body that an inner mass shakes along a plate: period and duty are driven, the mean speed is measured."""


_PULL_M_S = 5e-4  # of paper A


class PeriodsHead(Head):
    """`[rig]` with the speed, where it is no column."""

    velocity_m_s: float | None = None

    def check(self) -> None:
        speed = self.velocity_m_s
        if speed is not None and not SLOWEST_PULL <= speed <= 1:
            raise ValueError(
                f"[rig] velocity_m_s must be the speed of the pull, {SLOWEST_PULL:g} to 1 m/s; got {speed:g}"
            )

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "velocity_m_s": self.velocity_m_s}


def _periods_template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """Eight periods about the means that Zhang et al. (2016), Table 2, state for 0.5 mm/s."""
    means = {"period_s": 0.0912, "valley_N": 22.7e-3, "peak_N": 35.1e-3}
    rows = {name: mean * (1 + 0.03 * rng.standard_normal(8)) for name, mean in means.items()}
    return {"rig": {"kind": PERIODS.id, "velocity_m_s": _PULL_M_S}}, rows


PERIODS = RigKind(
    id="periods",
    layouts=(Columns((), ("period_s", "valley_N", "peak_N"), time=False, minimum=3, given_by_rig=("velocity_m_s",)),),
    usual={"period_s": (1e-3, 60.0, "s"), "valley_N": (0.0, 5.0, "N"), "peak_N": (1e-4, 5.0, "N")},
    head=PeriodsHead,
    tables={"capsule": PaperCapsuleTable, "tissue": PaperTissueTable},
    template=_periods_template,
    wanted="more periods",
    rising=("valley_N", "peak_N"),
    scatters=True,
    hooks=frozenset({"stiffening", "wall_force"}),
    signals=frozenset({"v", "direction", "drag", "drag_rate"}),
)
"""Periods of stick and slip of a capsule that is drawn at one speed: how long each lasts, its valley and its peak."""


def _spectrum_template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """A spectrum of the papers' five-element wall with the scatter of readings."""
    return {"rig": {"kind": DMA.id}}, {"frequency_Hz": np.geomspace(0.1, 50, 12)}


DMA = RigKind(
    id="dma",
    layouts=(Columns((("frequency_Hz",),), ("storage_modulus_Pa", "loss_modulus_Pa"), time=False, minimum=3),),
    template=_spectrum_template,
    wanted="more samples or frequencies",
    hooks=frozenset({"modulus"}),
    signals=frozenset(),
)
"""A sample of the wall in a dynamic test: its frequency is driven, both moduli are measured."""
