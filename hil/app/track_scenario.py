"""SCENARIO.toml of a closed loop: the truth of the plant, its instruments, where to go, and what the controller believes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

from controller.limits import Limits
from controller.trajectory import Trajectory
from hil.app.toml_file import read_toml
from hil.app.track_reference import read_reference
from models.parameter import nearest
from models.rig import TABLES as RIG_TABLES
from models.rig import Rig, parse_rig
from plant.instruments import Instrument
from plant.reading import from_table
from plant.rig import Rig as Truth
from plant.scenario import parse_truth
from plant.session import FEEDBACK, LOCALISATION, Instruments

Table = Mapping[str, Any]
TRUTH_TABLES: Final = ("scenario", "capsule", "tissue", "rig", "drive", "surface", "anatomy", "effects")
OWN_TABLES: Final = ("reference", "belief", "control", "limits", "localisation", "feedback")
TABLES: Final = TRUTH_TABLES + OWN_TABLES

_CAPSULE: Final = {"radius_m": 6.5e-3, "cylinder_length_m": 20e-3, "mass_kg": 4.0e-3}
_TISSUE: Final = {
    "preset": "jejunum",
    "wall_thickness_m": 2.5e-3,
    "contact_angle_deg": 60.0,
    "nose_force_angle_deg": 30.0,
    "friction_coefficient": 0.082,
    "mucus_thickness_m": 30e-6,
    "recovery_time_s": 0.05,
}
_HEAD: Final[Mapping[str, Table]] = {
    "magnetic": {"magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02},
    "coil": {"force_constant_N_per_A": 0.5, "coil_resistance_Ohm": 10.0, "coil_inductance_H": 10e-3, "current_limit_A": 1.0},
    "vibro": {},
}
_DRIVE: Final = {"inner_mass_kg": 0.074, "spring_stiffness_N_per_m": 256.23, "force_N": 1.25, "reaction_on_body": True}
_PLATE_BODY_KG: Final = 0.193
_PLATE_FRICTION: Final = 0.29
DRIVEN: Final[Mapping[str, str]] = {"magnetic": "", "coil": "coil_voltage_V", "vibro": ""}


@dataclass(frozen=True)
class Control:
    """Table `[control]`: the tick, which controller runs where the command line names none, and from when on tracking is judged."""

    tick_s: float = 1e-3
    controller: str = "feedforward"
    judged_from_s: float = 0.5

    def __post_init__(self) -> None:
        if not 1e-4 <= self.tick_s <= 0.02:
            raise ValueError(f"control.tick_s must lie in [1e-4, 0.02] s; got {self.tick_s:g}")
        if not self.judged_from_s >= 0:
            raise ValueError(f"control.judged_from_s must be zero or more; got {self.judged_from_s:g}")


@dataclass(frozen=True)
class TrackScenario:
    """A closed loop to run. `truth` and `instruments` are the plant's; `belief` is all that the controller is told of the rig."""

    name: str
    duration_s: float
    seed: int
    kind: str
    truth: Truth
    instruments: Instruments
    belief: Rig
    reference: Trajectory
    limits: Limits
    control: Control


def load_track_scenario(path: Path) -> TrackScenario:
    """Read and check a scenario file; a ValueError of one sentence says which key, what it must be and what it is."""
    raw, _ = read_toml(path, "scenario")
    try:
        return parse_track_scenario(raw)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_track_scenario(raw: Table) -> TrackScenario:
    """A closed loop from parsed TOML. Errors as `load_track_scenario`."""
    for name, table in raw.items():
        if name not in TABLES:
            raise ValueError(f"tables must be among {', '.join(TABLES)}; got [{name}]; {nearest(name, TABLES)}")
        if not isinstance(table, Mapping):
            raise ValueError(f"{name} must be a table; got {table!r}")
    run, kind, truth = parse_truth({name: table for name, table in raw.items() if name in TRUTH_TABLES})
    if kind not in _HEAD:
        raise ValueError(f"rig.kind must be one of {', '.join(_HEAD)} to be controlled; got {kind!r}")
    control = from_table(Control, raw.get("control", {}), "control")
    if not control.judged_from_s < run.duration_s:
        raise ValueError(
            f"control.judged_from_s must be below the duration of {run.duration_s:g} s; got {control.judged_from_s:g}"
        )
    ratio = control.tick_s / run.step_s
    if abs(ratio - round(ratio)) > 1e-6:
        raise ValueError(f"control.tick_s must be a multiple of the plant's step of {run.step_s:g} s; got {control.tick_s:g}")
    return TrackScenario(
        name=run.name or "unnamed",
        duration_s=run.duration_s,
        seed=run.seed,
        kind=kind,
        truth=truth,
        instruments=Instruments(
            _instrument(raw.get("localisation", {}), "localisation", LOCALISATION),
            _instrument(raw.get("feedback", {}), "feedback", FEEDBACK),
        ),
        belief=_belief(raw.get("belief", {}), kind, raw.get("surface", {}).get("kind", "gut")),
        reference=read_reference(raw.get("reference", {}), run.duration_s),
        limits=_limits(raw.get("limits", {})),
        control=control,
    )


def _instrument(table: Table, where: str, nominal: Instrument) -> Instrument:
    return from_table(Instrument, {f.name: _plain(getattr(nominal, f.name)) for f in fields(Instrument)} | dict(table), where)


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _limits(table: Table) -> Limits:
    return from_table(Limits, table, "limits")


def _belief(table: Table, kind: str, surface: str) -> Rig:
    """The rig file that the experimenter would have written: `[belief.*]` over nominal values."""
    for name, content in table.items():
        if name not in RIG_TABLES:
            raise ValueError(f"tables of [belief] must be those of a rig file; got {name!r}; {nearest(name, RIG_TABLES)}")
        if not isinstance(content, Mapping):
            raise ValueError(f"belief.{name} must be a table; got {content!r}")
    capsule = dict(_CAPSULE)
    if kind == "vibro":
        capsule["mass_kg"] = _PLATE_BODY_KG
    nominal: dict[str, Table] = {"capsule": capsule, "rig": {"kind": kind, **_HEAD[kind]}}
    if kind != "vibro" or surface == "gut":
        nominal["tissue"] = _TISSUE
    if kind == "vibro":
        nominal["drive"] = _DRIVE
        nominal["surface"] = {"kind": "gut"} if surface == "gut" else {"kind": "plate", "friction_coefficient": _PLATE_FRICTION}
    merged = {name: {**nominal.get(name, {}), **table.get(name, {})} for name in {**nominal, **table}}
    if merged["rig"]["kind"] != kind:
        raise ValueError(f"belief.rig.kind must be the plant's, {kind!r}; got {merged['rig']['kind']!r}")
    return parse_rig(merged, "belief")
