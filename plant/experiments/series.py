"""A made-up experiment: three training records and a hold-out of one rig whose numbers are off and which may have one
hidden effect.
"""

from __future__ import annotations

import gzip
import io
from dataclasses import fields, replace
from pathlib import Path
from typing import Final, Literal, get_args

import numpy as np

from models.files.writing import draft
from models.laws.geometry import Capsule, Tissue
from plant import layout as at
from plant.drives.kinds import Magnet, Pull
from plant.experiments.excitation import random_runs, random_wander
from plant.experiments.recording import record_scenario
from plant.experiments.scenario import Run, Scenario
from plant.experiments.series_rigs import BELIEVED
from plant.hidden.registry import hidden
from plant.hidden.table import draw
from plant.rig import STEP_S, Plant, Rig
from plant.sensing.sensors import Sensor
from plant.tables import Floats

Kind = Literal["pull", "magnetic", "coil", "coil_voltage", "vibro", "vibro_plate", "magnetic_plate", "coil_plate"]
KINDS: Final[tuple[Kind, ...]] = get_args(Kind)
RECORDS: Final = ("train_1", "train_2", "train_3", "holdout")
FORCE_STD_N: Final = 1e-3
POSITION_STD_M: Final = 5e-5
FORCE_SPAN_N: Final = 0.25
POSITION_SPAN_M: Final = 25e-3
_EVERY = 10  # steps between the samples that the sensor sees
_NOMINAL_MAGNET = Magnet()


def make_series(
    kind: Kind,
    effect: str | None,
    seed: int,
    out: Path,
    duration_s: float = 45.0,
    noise: float = 1.0,
    rate_Hz: float = 500.0,
) -> Path:
    """Write `train_1..3.csv.gz`, `holdout.csv.gz`, `rig.toml` (nominal values) and `answer.toml` (the truth) to the
    folder `out`.

    The truth's hoop stress factor and friction differ from nominal by up to 15 %, the magnet's stiffness by up to 5 %,
    a coil's or inner mass's force and spring (a magnet's on a plate too) by up to 7 %; `coil` logs the coil's current,
    `coil_voltage` the voltage alone, where what acts before the current shows; `vibro` is a capsule in the gut,
    `vibro_plate` the capsubot on a plate, `magnetic_plate` and `coil_plate` a capsule on one. `effect` is a hidden
    effect's id, or several joined by "+", with numbers drawn from their ranges, or None. Samples at `rate_Hz`; noise
    `noise` times 1 mN on a pull's force, 50 um on a position, as the rig file states it. The same seed gives the same
    bytes; its rig, drive and noise stay the same with another effect. Raises `ValueError` for an unknown kind or
    effect, or one that the drive cannot have.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}; got {kind!r}")
    ids = hidden_ids(effect)
    for name in ids:
        if drive_kind(kind) not in hidden(name).drives:
            raise ValueError(
                f"effect of a {kind} rig must be one for that kind; got {name!r}, which is for"
                f" {', '.join(hidden(name).drives)}"
            )
    truth, *streams = (np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(2 + len(RECORDS)))
    effect_stream, *record_streams = streams
    rig = replace(_truth(kind, truth), hidden={name: draw(name, effect_stream) for name in ids})
    out.mkdir(parents=True, exist_ok=True)
    for name, stream in zip(RECORDS, record_streams, strict=True):
        columns = _record(kind, rig, stream, duration_s, noise, rate_Hz)
        write_record(out / f"{name}.csv.gz", columns)
    write_text(out / "rig.toml", rig_text(kind, noise))
    write_text(out / "answer.toml", _answer_text(rig, effect, seed))
    return out


def _truth(kind: Kind, rng: np.random.Generator) -> Rig:
    """The rig as it is, without what is hidden."""
    if kind in BELIEVED:
        return BELIEVED[kind].truth(rng)
    hoop, friction, magnet = rng.uniform(0.85, 1.15), rng.uniform(0.85, 1.15), rng.uniform(0.95, 1.05)
    return Rig(
        drive=(
            Pull()
            if kind == "pull"
            else Magnet(_NOMINAL_MAGNET.magnet_stiffness_N_per_m * magnet, _NOMINAL_MAGNET.magnet_range_m)
        ),
        tissue=Tissue(friction_coefficient=Tissue().friction_coefficient * friction),
        hoop_factor=float(hoop),
    )


def _record(
    kind: Kind, rig: Rig, rng: np.random.Generator, duration_s: float, noise: float, rate_Hz: float
) -> dict[str, Floats]:
    pulled = kind == "pull"
    std, span = (FORCE_STD_N, FORCE_SPAN_N) if pulled else (POSITION_STD_M, POSITION_SPAN_M)
    sensor = Sensor(rate_Hz, noise * std, span=span)
    if kind in BELIEVED:
        belief, run = BELIEVED[kind], Run("", duration_s, int(rng.integers(2**31)), rig.step_s)
        columns = record_scenario(Scenario(run, belief.kind, rig, belief.profile, sensor))
        return {name: values for name, values in columns.items() if name not in belief.unlogged}
    drive = random_runs(rng, duration_s, STEP_S) if pulled else random_wander(rng, duration_s, STEP_S)
    plant = Plant(rig)
    rows = plant.advance(drive, _EVERY)
    t, reading = sensor.measure(rows[:, at.O_T], rows[:, at.O_FORCE if pulled else at.O_X], rng, plant.effects)
    driven = np.interp(t, np.arange(drive.size) * STEP_S, drive)
    names = ("position_m", "force_N") if pulled else ("carriage_position_m", "position_m")
    return {"t_s": t, names[0]: driven, names[1]: reading}


def write_record(path: Path, columns: dict[str, Floats]) -> None:
    """Write columns as CSV (gzipped for `.gz`), complete or not at all: a temporary file beside `path` takes its name
    at the end.
    """
    table = io.StringIO()
    np.savetxt(
        table, np.column_stack(list(columns.values())), delimiter=",", fmt="%.9g", header=",".join(columns), comments=""
    )
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


def rig_text(kind: Kind, noise: float = 1.0) -> str:
    """The rig file that the experimenter believes: nominal values in the keys of interfaces.md, `noise` times the usual
    noise.
    """
    belief = BELIEVED.get(kind)
    capsule, tissue = Capsule() if belief is None else belief.nominal.capsule, Tissue()
    lines = ["# rig of one experiment series; SI units", "[capsule]"]
    sizes = () if belief and belief.nominal.surface else ("radius_m", "cylinder_length_m")
    lines += [f"{name} = {getattr(capsule, name)!r}" for name in (*sizes, "mass_kg")]
    if sizes:
        lines += ["", "[tissue]", 'preset = "jejunum"']
        lines += [f"{name} = {getattr(tissue, name)!r}" for name in tissue.__dataclass_fields__]
    lines += ["", "[rig]", f'kind = "{kind}"'] if belief is None else belief.tables()
    if kind == "magnetic":
        lines += [f"{name} = {getattr(_NOMINAL_MAGNET, name)!r}" for name in (f.name for f in fields(_NOMINAL_MAGNET))]
    pulled = kind == "pull"
    stated = f"force_std_N = {noise * FORCE_STD_N!r}" if pulled else f"position_std_m = {noise * POSITION_STD_M!r}"
    return "\n".join([*lines, "", "[noise]", stated, ""])


def drive_kind(kind: Kind) -> str:
    """The kind of drive that a kind of series has."""
    return BELIEVED[kind].kind if kind in BELIEVED else kind


def hidden_ids(effect: str | None) -> list[str]:
    """The ids that `effect` names, joined by "+"; none for None."""
    return effect.split("+") if effect else []


def _answer_text(rig: Rig, effect: str | None, seed: int) -> str:
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
