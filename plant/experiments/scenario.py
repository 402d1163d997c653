"""SCENARIO.toml: the true rig, what is commanded, measured and hidden, and the record that it gives."""

import gzip
import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np

from models.files.access import draft
from models.files.toml import (
    check_known,
    check_tables,
    check_word,
    converted,
    in_file,
    is_number,
    list_of_numbers,
    read_toml,
    shown,
    with_contact_angle,
)
from models.laws.geometry import GRAVITY, Capsule, Tissue
from models.rigs.magnets import Magnet as MagnetTable
from models.rigs.magnets import read_magnets
from models.rigs.schema import Table as RigTable
from models.rigs.schema import check_range, checked, from_table
from models.rigs.tables import Axis, BodyTable, CapsuleTable, DriveTable, SurfaceTable, TissueTable
from models.rigs.tables import Noise as NoiseTable
from plant import layout as at
from plant.anatomy import Anatomy, along, random_anatomy
from plant.drives import (
    DRIVES,
    ForcedAxis,
    TrueAxis,
    TrueCoil,
    TrueDrive,
    TrueMagnet,
    TrueMagnetPair,
    TrueVibro,
    TurnedAxis,
    TurningAxis,
)
from plant.experiments.profile import PROFILES, Profile, Pwm, Recorded
from plant.hidden.registry import AXIS, COIL, MAGNETIC, VIBRO, hidden
from plant.hidden.table import effect_table
from plant.rig import STEP_S, Plant, TruePlate, Truth
from plant.sensing import FASTEST_HZ, Sensor
from plant.tables import Floats

Table = Mapping[str, Any]
TABLES: Final = (
    *("scenario", "capsule", "tissue", "rig", AXIS, "drive", "surface"),
    *("profile", "sensor", "accelerometer", "load_cell", "noise", "anatomy", "effects"),
)
MOST_STEPS: Final = 50_000_000  # of a simulation: a thousand seconds at the usual step
SHORTEST_STEP_S: Final = 1e-6  # of the compiled step
LONGEST_STEP_S: Final = 1e-2  # of the compiled step
_DRIVE_TABLES: Final[dict[type[TrueDrive], dict[str, type[RigTable]]]] = {
    TrueMagnet: {"rig": MagnetTable},
    TrueVibro: {"drive": DriveTable, "rig": DriveTable},
}
ANATOMY_KEYS: Final = ("places_m", "level", "seed")


@dataclass(frozen=True)
class RunTable:
    """Duration, seed and step; table `[scenario]`."""

    name: str = ""
    duration_s: float = 20.0
    seed: int = 0
    step_s: float = STEP_S


@dataclass(frozen=True)
class SensorNoise:
    """White noise and rounding of the measured column, in its unit; table `[noise]`."""

    force_std_N: float = 0.0
    position_std_m: float = 0.0
    torque_std_N_m: float = 0.0
    angle_std_rad: float = 0.0
    force_quantum_N: float = 0.0
    position_quantum_m: float = 0.0
    torque_quantum_N_m: float = 0.0
    angle_quantum_rad: float = 0.0


@dataclass(frozen=True)
class Sampling:
    """Table `[sensor]`."""

    rate_Hz: float = 500.0
    delay_s: float = 0.0
    lowpass_s: float = 0.0


@dataclass(frozen=True)
class Accelerometer:
    """An accelerometer on a free capsule; table `[accelerometer]`. Speeds twice through its low-pass, differences over
    each interval, with white noise `std_m_s2` and the zero `bias_m_s2`.
    """

    column: ClassVar[str] = "acceleration_m_s2"
    rate_Hz: float = 500.0
    std_m_s2: float = 0.05
    bias_m_s2: float = 0.1
    delay_s: float = 0.0
    lowpass_s: float = 3e-4

    def read(self, rows: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Its stamps in s and its readings of the plant's `rows`."""
        seen, times = Sensor(self.rate_Hz, 0.0, 0.0, self.delay_s, self.lowpass_s), rows[:, at.O_T]
        t, v = seen.measure(times, seen.filtered(times, rows[:, at.O_V]), rng)
        a = np.diff(v, prepend=v[0]) * self.rate_Hz + self.bias_m_s2 + self.std_m_s2 * rng.standard_normal(len(t))
        return t, a


@dataclass(frozen=True)
class LoadCell:
    """A load cell between a magnet or a coil and its capsule; table `[load_cell]`. Its zero is `bias_N`."""

    column: ClassVar[str] = "drive_force_N"
    rate_Hz: float = 500.0
    std_N: float = 1e-3
    bias_N: float = 5e-3
    delay_s: float = 0.0
    lowpass_s: float = 2e-3

    def read(self, rows: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        seen = Sensor(self.rate_Hz, self.std_N, 0.0, self.delay_s, self.lowpass_s)
        return seen.measure(rows[:, at.O_T], rows[:, at.O_FORCE] + self.bias_N, rng)


Instrument = Accelerometer | LoadCell
_INSTRUMENTS: Final[dict[str, tuple[type[Instrument], tuple[str, ...]]]] = {
    "accelerometer": (Accelerometer, (MAGNETIC, COIL, VIBRO)),
    "load_cell": (LoadCell, (MAGNETIC, COIL)),
}


def _one_clock(rate_Hz: float, series: Mapping[str, tuple[Floats, Floats]]) -> tuple[Floats, dict[str, Floats]]:
    """The stamps of the fastest of `series` of (stamps, values), and each at the nearest stamp, else NaN."""
    t = max((stamps for stamps, _ in series.values()), key=len)
    found = {name: np.full(len(t), np.nan) for name in series}
    for name, (stamps, values) in series.items():
        found[name][np.clip(np.round(stamps * rate_Hz).astype(int), 0, len(t) - 1)] = values
    return t, found


@dataclass(frozen=True)
class Scenario:
    run: RunTable
    kind: str
    rig: Truth
    profile: Profile
    sensor: Sensor
    instruments: tuple[Instrument, ...] = ()


def load_scenario(path: Path) -> Scenario:
    """Read and check a scenario file; a `ValueError` states the key, what it must be and what it is."""
    raw, _ = read_toml(path, "scenario")
    with in_file(path):
        return parse_scenario(raw, path.parent)


def parse_scenario(raw: Table, folder: Path) -> Scenario:
    """A scenario from parsed TOML; paths are relative to `folder`. Errors as `load_scenario`."""
    check_tables(raw, TABLES)
    run, kind, rig = parse_truth(raw)
    instruments = list[Instrument]()
    for name, (table, kinds) in ((name, own) for name, own in _INSTRUMENTS.items() if name in raw):
        one = from_table(table, raw[name], name)
        if kind not in kinds or not 0 < one.rate_Hz <= FASTEST_HZ:
            raise ValueError(
                f"[{name}] must be that of a rig of kind {', '.join(kinds)}, its rate_Hz positive and at most"
                f" {FASTEST_HZ:g}; got a {kind} rig and {one.rate_Hz:g}"
            )
        instruments.append(one)
    return Scenario(run, kind, rig, _profile(raw.get("profile", {}), folder), _sensor(raw, rig.drive), (*instruments,))


def parse_truth(raw: Table) -> tuple[RunTable, str, Truth]:
    run = from_table(RunTable, raw.get("scenario", {}), "scenario")
    if not SHORTEST_STEP_S <= run.step_s <= LONGEST_STEP_S:
        raise ValueError(f"scenario.step_s must be {SHORTEST_STEP_S:g} to {LONGEST_STEP_S:g} s; got {run.step_s:g}")
    if not run.step_s <= run.duration_s <= MOST_STEPS * run.step_s:
        raise ValueError(
            f"scenario.duration_s must be {run.step_s:g} to {MOST_STEPS * run.step_s:g} s, at most {MOST_STEPS:.0e}"
            f" steps of {run.step_s:g} s; got {run.duration_s:g} s"
        )
    kind = check_word(raw.get("rig", {}).get("kind"), "rig.kind", DRIVES)
    if kind == AXIS:
        return run, kind, replace(_axis(raw), hidden=_effects(raw.get("effects", {}), kind), step_s=run.step_s)
    if AXIS in raw:
        raise ValueError(f"[axis] must be left out of a {kind} rig")
    body = BodyTable if raw.get("surface", {}).get("kind", "gut") != "gut" else CapsuleTable
    models: dict[str, type[RigTable]] = {"capsule": body, "tissue": TissueTable, "noise": NoiseTable}
    models |= {"surface": SurfaceTable, **_DRIVE_TABLES.get(DRIVES[kind], {})}
    for name, model in models.items():
        for key, value in raw.get(name, {}).items():
            if key in model.model_fields and is_number(value) and value:  # 0 switches a number off
                check_range(model, key, value, name)
    capsule = from_table(Capsule, raw.get("capsule", {}), "capsule")
    tissue, hoop = _tissue(raw.get("tissue", {}), capsule)
    rig = Truth(
        drive=_drive(kind, raw),
        capsule=capsule,
        tissue=tissue,
        surface=_surface(raw.get("surface", {"kind": "gut"})),
        hoop_factor=hoop,
        anatomy=_anatomy(raw.get("anatomy", {})),
        hidden=_effects(raw.get("effects", {}), kind),
        step_s=run.step_s,
    )
    return run, kind, rig


_OF_AXIS: Final = ("scenario", "rig", AXIS, "profile", "sensor", "noise", "effects")
_AXES: Final = {
    ("", False): TrueAxis,
    ("", True): TurningAxis,
    ("force_N", False): ForcedAxis,
    ("torque_N_m", True): TurnedAxis,
}


def _axis(raw: Table) -> Truth:
    """An axis in the keys of its rig file, all numbers of one that moves along a line, or of one that turns."""
    strange = next((name for name in raw if name not in _OF_AXIS), None)
    if strange is not None:
        raise ValueError(f"tables of an axis must be among {', '.join(_OF_AXIS)}; got [{strange}]")
    head = dict(raw["rig"])
    driven = check_word(head.pop("driven", ""), "rig.driven", {driven for driven, _ in _AXES})
    further = next((key for key in head if key != "kind"), None)
    if further is not None:
        raise ValueError(f"[rig] of an axis must have kind and driven alone; got {further!r}")
    table = checked("scenario", AXIS, Axis, raw.get(AXIS, {})).model_dump(exclude_none=True)
    keys = list(Axis.model_fields)
    line, turn = keys[:4], keys[4:8]
    turns = turn[0] in table
    names = turn if turns else line
    strange = next((key for key in table if key not in names), None)
    if names[0] not in table or strange is not None or (driven, turns) not in _AXES:
        raise ValueError(
            f"[axis] must have {line[0]} and may have {', '.join(line[1:])}, under torque_N_m or for angles those of an"
            f" axis that turns, {', '.join(turn)}; got {', '.join(table) or 'none'} with driven {driven or 'its place'}"
        )
    mass, viscous, coulomb, offset = (float(table.get(name, 0.0)) for name in names)
    plate = TruePlate(coulomb / (mass * GRAVITY))
    return Truth(_AXES[driven, turns](viscous, offset), Capsule(mass_kg=mass), surface=plate)


def _drive(kind: str, raw: Table) -> TrueDrive:
    rig, drive = raw.get("rig", {}), raw.get("drive", {})
    if DRIVES[kind] is not TrueMagnet or "magnet" not in rig:
        where = "drive" if DRIVES[kind] in (TrueCoil, TrueVibro) else "rig"
        table = {**drive, **{key: value for key, value in rig.items() if key != "kind"}}
        return from_table(DRIVES[kind], table, where)
    further = next((key for key in rig if key not in ("kind", "magnet")), None)
    if further is not None:
        raise ValueError(f"[rig] with a table [rig.magnet] must have no further key but kind; got {further!r}")
    both = read_magnets(rig["magnet"], "scenario")
    return TrueMagnetPair(both.moment("outer"), both.moment("inner"), both.height_m, both.moments == "along")


def _tissue(table: Table, capsule: Capsule) -> tuple[Tissue, float]:
    preset = table.get("preset", "jejunum")
    if preset != "jejunum":
        raise ValueError(f"tissue.preset must be 'jejunum'; got {preset!r}")
    hoop = converted(table.get("hoop_stress_factor", 1.0), float, "tissue.hoop_stress_factor")
    if not 0.01 <= hoop <= 100:
        raise ValueError(f"tissue.hoop_stress_factor must be 0.01 to 100; got {hoop:g}")
    table = with_contact_angle(table, capsule.radius_m)
    return from_table(Tissue, table, "tissue", skip=("preset", "hoop_stress_factor")), hoop


def _surface(table: Table) -> TruePlate | None:
    kind = check_word(table.get("kind"), "surface.kind", ("gut", "plate", "air"))
    if kind != "plate" and len(table) > 1:
        raise ValueError(
            f"[surface] of kind {kind} must have no further keys; got {', '.join(k for k in table if k != 'kind')}"
        )
    if kind == "air":
        return TruePlate(0.0)
    return None if kind == "gut" else from_table(TruePlate, table, "surface", skip=("kind",))


def _anatomy(table: Table) -> Anatomy:
    check_known(table, ANATOMY_KEYS, "keys of [anatomy] must be among")
    profile = Anatomy() if "seed" not in table else random_anatomy(converted(table["seed"], int, "anatomy.seed"))
    if "places_m" in table or "level" in table:
        places_m, level = (list_of_numbers(table.get(key), f"anatomy.{key}") for key in ("places_m", "level"))
        stated = along(places_m, level)
        profile = stated if len(profile.level) == 1 else profile.times(stated)
    return profile


def _effects(table: Table, kind: str) -> dict[str, dict[str, float]]:
    for name, numbers in table.items():
        if kind not in hidden(name).drives:
            raise ValueError(
                f"effects of a {kind} rig must be for it; got {name!r}, which is for {', '.join(hidden(name).drives)}"
            )
        if not isinstance(numbers, Mapping):
            raise ValueError(f"effects.{name} must be a table of its numbers; got {shown(numbers)}")
    chosen = {
        name: {key: converted(value, float, f"effects.{name}.{key}") for key, value in numbers.items()}
        for name, numbers in table.items()
    }
    effect_table(chosen)
    return chosen


def _profile(table: Table, folder: Path) -> Profile:
    kind = check_word(table.get("kind"), "profile.kind", PROFILES)
    profile = from_table(PROFILES[kind], table, "profile", skip=("kind",))
    return replace(profile, folder=str(folder)) if isinstance(profile, Recorded) else profile


def _sensor(raw: Table, drive: TrueDrive) -> Sensor:
    sampling = from_table(Sampling, raw.get("sensor", {}), "sensor")
    noise = from_table(SensorNoise, raw.get("noise", {}), "noise")
    column, unit = drive.unit
    std, quantum = (float(getattr(noise, f"{column}_{what}_{unit}")) for what in ("std", "quantum"))
    return Sensor(sampling.rate_Hz, std, quantum, sampling.delay_s, sampling.lowpass_s)


_FASTEST_ROWS = 10  # steps between the truth's samples at most


def record_scenario(scenario: Scenario, rng: np.random.Generator | None = None) -> dict[str, Floats]:
    """Columns of interfaces.md for the rig's kind: time, driven and measured columns; `drive_on` is the share of the
    time since the last sample. Profile and sensor draw from streams of the scenario's seed, or from `rng` if given.
    Raises `ValueError` for unusable drive values.
    """
    dt, seeds = scenario.rig.step_s, np.random.SeedSequence(scenario.run.seed).spawn(2)
    first, second = (rng or np.random.default_rng(seed) for seed in seeds)
    drive = scenario.profile.values(scenario.run.duration_s, dt, first)
    truth = scenario.rig.drive
    switched = isinstance(scenario.profile, Pwm)
    plant = Plant(scenario.rig)
    if isinstance(truth, TrueAxis) and not isinstance(truth, ForcedAxis):
        plant.state[at.S_V] = (drive[1] - drive[0]) / dt  # no blow of a heavy stage at the start
    finest = 1 if rng is None else _FASTEST_ROWS
    rate = max(scenario.sensor.rate_Hz, *(one.rate_Hz for one in scenario.instruments), 0.0)
    every = int(np.clip(0.25 / (rate * dt), finest, _FASTEST_ROWS))
    rows = plant.advance(drive * truth.command_scale if switched else drive, every)
    measured = rows[:, truth.measured]
    t, reading = scenario.sensor.measure(rows[:, at.O_T], measured, second, plant.effects)
    series = {"reading": (t, reading)} | {one.column: one.read(rows, second) for one in scenario.instruments}
    t, seen = _one_clock(rate, series)
    times = dt * np.arange(drive.size)
    sums = np.interp(t, times, np.concatenate([[0.0], np.cumsum(drive[:-1]) * dt]))
    taken = {
        "reading": seen.pop("reading"),
        "commanded": np.interp(t, times, drive),
        "mean": np.append(drive[0], np.diff(sums) / np.diff(t)),
        "current": np.interp(t, rows[:, at.O_T], rows[:, at.O_CURRENT]),
    }
    columns = {name: taken[what] for name, what in truth.columns().items()}
    if "drive_on" in columns and not switched:
        columns = {"drive_force_N" if name == "drive_on" else name: values for name, values in columns.items()}
    return {"t_s": t, **columns, **seen}


def write_record(path: Path, columns: Mapping[str, Floats]) -> None:
    """Write columns as CSV (gzipped for `.gz`), complete or not at all."""
    table, rows = io.StringIO(), np.column_stack(list(columns.values()))
    np.savetxt(table, rows, delimiter=",", fmt="%.9g", header=",".join(columns), comments="")
    data = table.getvalue().replace("nan", "").encode()
    made = draft(path, gzip.compress(data, mtime=0) if path.suffix == ".gz" else data)
    try:
        made.replace(path)
    finally:
        made.unlink(missing_ok=True)
