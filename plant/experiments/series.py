"""A made-up experiment: training records and a hold-out of a rig that is off nominal, maybe with a hidden effect."""

import gzip
import io
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from models.files.access import draft
from models.laws.geometry import Tissue
from plant.experiments.recording import record_scenario
from plant.experiments.scenario import RunTable, Scenario
from plant.experiments.series_rigs import BELIEVED
from plant.hidden.registry import hidden
from plant.hidden.table import draw
from plant.rig import Truth
from plant.sensing.sensors import Sensor
from plant.tables import Floats

KINDS: Final = tuple(BELIEVED)
RECORDS: Final = ("train_1", "train_2", "train_3", "holdout")
FORCE_STD_N: Final = 1e-3  # noise and span of a made-up sensor: force cell, localisation
POSITION_STD_M: Final = 5e-5
FORCE_SPAN_N: Final = 0.25
POSITION_SPAN_M: Final = 25e-3


def make_series(
    kind: str,
    effect: str | None,
    seed: int,
    out: Path,
    duration_s: float = 45.0,
    noise: float = 1.0,
    rate_Hz: float = 500.0,
) -> Path:
    """Write `train_1..3.csv.gz`, `holdout.csv.gz`, `rig.toml` (nominal values) and `answer.toml` (the truth) to `out`.

    The truth differs from nominal by up to 15 % in hoop stress and friction, 5 % in a magnet's stiffness, 7 % in a
    coil's or inner mass's force and spring (a magnet's on a plate too). `coil` logs the current, `coil_voltage` the
    voltage alone; `vibro` is in the gut, `vibro_plate` the capsubot on a plate. `effect` is a hidden effect's id, or
    several joined by "+", with numbers drawn from their ranges. `noise` times 1 mN on a pull's force, 50 um on a
    position. The same seed gives the same bytes; its rig, drive and noise stay the same with another effect. Raises
    `ValueError` for an unknown kind or effect, or one that the drive cannot have.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}; got {kind!r}")
    ids = hidden_ids(effect)
    for name in ids:
        if BELIEVED[kind].kind not in hidden(name).drives:
            raise ValueError(
                f"effect of a {kind} rig must be one for that kind; got {name!r}, which is for"
                f" {', '.join(hidden(name).drives)}"
            )
    truth, *streams = (np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(2 + len(RECORDS)))
    effect_stream, *record_streams = streams
    belief = BELIEVED[kind]
    rig = replace(belief.truth(truth), hidden={name: draw(name, effect_stream) for name in ids})
    std, span = (FORCE_STD_N, FORCE_SPAN_N) if belief.pulled else (POSITION_STD_M, POSITION_SPAN_M)
    sensor = Sensor(rate_Hz, noise * std, span=span)
    out.mkdir(parents=True, exist_ok=True)
    for name, rng in zip(RECORDS, record_streams, strict=True):
        run = RunTable("", duration_s, 0 if belief.plain else int(rng.integers(2**31)), rig.step_s)
        scenario = Scenario(run, belief.kind, rig, belief.profile, sensor)
        columns = record_scenario(scenario, rng if belief.plain else None)
        write_record(out / f"{name}.csv.gz", {n: v for n, v in columns.items() if n not in belief.unlogged})
    write_text(out / "rig.toml", rig_text(kind, noise))
    write_text(out / "answer.toml", _answer_text(rig, effect, seed))
    return out


def write_record(path: Path, columns: dict[str, Floats]) -> None:
    """Write columns as CSV (gzipped for `.gz`), complete or not at all."""
    table, rows = io.StringIO(), np.column_stack(list(columns.values()))
    np.savetxt(table, rows, delimiter=",", fmt="%.9g", header=",".join(columns), comments="")
    data = table.getvalue().encode()
    _replace(path, gzip.compress(data, mtime=0) if path.suffix == ".gz" else data)


def write_text(path: Path, text: str) -> None:
    """Write a text file, complete or not at all."""
    _replace(path, text.encode())


def _replace(path: Path, data: bytes) -> None:
    made = draft(path, data)
    try:
        made.replace(path)
    finally:
        made.unlink(missing_ok=True)


def rig_text(kind: str, noise: float = 1.0) -> str:
    """The rig file that the experimenter believes: nominal values, `noise` times the usual noise."""
    belief = BELIEVED[kind]
    capsule, tissue = belief.nominal.capsule, Tissue()
    lines = ["# rig of one experiment series; SI units", "[capsule]"]
    sizes = () if belief.nominal.surface else ("radius_m", "cylinder_length_m")
    lines += [f"{name} = {getattr(capsule, name)!r}" for name in (*sizes, "mass_kg")]
    if sizes:
        lines += ["", "[tissue]", 'preset = "jejunum"']
        lines += [f"{name} = {getattr(tissue, name)!r}" for name in tissue.__dataclass_fields__]
    lines += belief.tables()
    name, std = ("force_std_N", FORCE_STD_N) if belief.pulled else ("position_std_m", POSITION_STD_M)
    return "\n".join([*lines, "", "[noise]", f"{name} = {noise * std!r}", ""])


def hidden_ids(effect: str | None) -> list[str]:
    """The ids that `effect` names, joined by "+"; none for None."""
    return effect.split("+") if effect else []


def _answer_text(rig: Truth, effect: str | None, seed: int) -> str:
    lines = [f'effect = "{effect or "none"}"', f"seed = {seed}"]
    lines += [] if rig.surface else [f"hoop_stress_factor = {rig.hoop_factor:.6g}"]
    lines += [f"friction_coefficient = {(rig.surface or rig.tissue).friction_coefficient:.6g}"]
    lines += [f"{name} = {value:.6g}" for name, value in rig.drive.numbers().items()]
    for name, numbers in rig.hidden.items():
        lines += [
            "",
            f"[parameters.{name}]" if len(rig.hidden) > 1 else "[parameters]",
            f'form = "{hidden(name).form}"',
            f"published = {str(hidden(name).published).lower()}",
        ]
        lines += [f"{key} = {value:.6g}" for key, value in numbers.items()]
    return "\n".join([*lines, ""])
