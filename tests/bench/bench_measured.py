"""What is found in the measured sets: verdict, parts, held-out error beside a plain fit, and what is known.

`python -m tests.bench.bench_measured [--out FILE] [--seed 0] [SET ...]` closes the loop on each set and prints a row.
A plain fit is least squares with the physically right terms, as the set's README states it; `times` is the held-out
error over the plain fit's. A 95 % interval that misses what is known of its number is printed as wrong, and so is an
effect that the set cannot have, unless one that it can have stands in its class. Without held-out records both errors
are those of the training. What is on file is not run again.
"""

import argparse
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from models.files.access import read_json
from models.identification import close
from models.records.record import Record, read_record, record_of
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from tests.bench.bench_capsubot import RIG as CAPSUBOT
from tests.places import SHARED

DATA: Final = SHARED / "data"
AXIS: Final[dict[str, Any]] = {"rig": {"kind": "axis"}}
COUNT_N_M: Final = 3.9811e-5  # a count of the spindle's torque cells
PAPER: Final = {"rig": {"kind": "periods", "velocity_m_s": 0.5e-3}}
Reader = Callable[[Rig, str], Record]


def plain(folder: str) -> Reader:
    return lambda rig, name: read_record(DATA / folder / name, rig)


def spindle(rig: Rig, name: str) -> Record:
    """Encoder and torque cell of the driven end; the load is the torque of the other end's cell."""
    t, counts, back, front = np.loadtxt(
        DATA / "spindle" / f"{name}.TXT.gz", comments="%", delimiter=",", usecols=(0, 1, 2, 5), unpack=True
    )
    rises = np.append(True, np.diff(t) > 0)
    columns = {
        "t_s": t,
        "angle_rad": 2 * np.pi / 8192 * counts,
        "torque_N_m": -COUNT_N_M * back,
        "load_N_m": -COUNT_N_M * front,
    }
    return record_of(name, {key: values[rises] for key, values in columns.items()}, rig)


def piston(rig: Rig, name: str) -> Record:
    path = DATA / "piston" / f"Kidney_lc_{name}bar.csv.gz"
    t, place, pressure, force = np.loadtxt(path, delimiter="\t", usecols=(0, 4, 5, 6), unpack=True)
    rises = np.append(True, np.diff(t) > 0)
    columns = {"t_s": 1e-3 * t, "position_m": 1e-3 * place, "force_N": force, "pressure_Pa": 1e5 * pressure}
    return record_of(name, {key: values[rises] for key, values in columns.items()}, rig)


def pendulum(rig: Rig, name: str) -> Record:
    path = DATA / "pendulum" / f"{name}.csv.gz"
    t, angle, torque = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 3), unpack=True)
    rises = np.append(True, np.diff(t) > 0)
    columns = {"t_s": t[rises], "angle_rad": angle[rises], "torque_N_m": torque[rises]}
    return record_of(name, columns, rig)


@dataclass(frozen=True)
class MeasuredSet:
    """A set: the rig, its records, the held-out error of a `plain` fit in the unit of ours (NaN: none is known), the
    range that the `truth` of numbers has, by name, and effects that it `cannot` have.
    """

    rig: Mapping[str, Any]
    read: Reader
    train: tuple[str, ...]
    held_out: tuple[str, ...] = ()
    plain: float = np.nan
    truth: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    cannot: tuple[str, ...] = ()


GRAVITY: Final = {"gravity_over_angle.torque_N_m": (3.25, 3.39)}
SETS: Final = {
    "emps": MeasuredSet(AXIS, plain("emps"), ("train.csv",), ("test_pulses.csv",), 5.34),
    "emps_forward": MeasuredSet(
        {"rig": {"kind": "axis", "driven": "force_N"}}, plain("emps"), ("train.csv",), ("test_pulses.csv",), 4.7e-3
    ),
    "spindle_many": MeasuredSet(
        AXIS,
        spindle,
        ("00", "03", "06", "40", "43", "46"),
        ("21", "25"),
        14.2,
        {"load_force.per_load": (1.0, 1.1)},
        ("gravity_over_angle",),
    ),
    "spindle_one": MeasuredSet(AXIS, spindle, ("03", "43"), (), 7.9, cannot=("gravity_over_angle",)),
    "piston": MeasuredSet(
        AXIS, piston, ("1", "3", "7"), ("5",), 0.6, {"load_force.per_pressure_Pa": (-5.16e-4, -4.96e-4)}, ("warming",)
    ),
    "pendulum": MeasuredSet(AXIS, pendulum, ("ddp",), ("direct_collocation",), 12.7, GRAVITY),
    "pendulum_back": MeasuredSet(AXIS, pendulum, ("direct_collocation",), ("ddp",), np.nan, GRAVITY),
    "capsubot": MeasuredSet(CAPSUBOT, plain("capsubot"), ("mean_velocity.csv",)),
    "paper_periods": MeasuredSet(PAPER, plain("seeds"), ("analytical_table2_periods.csv",)),
    "paper_moduli": MeasuredSet({"rig": {"kind": "dma"}}, plain("seeds"), ("viscoelastic_table2_dma.csv",)),
}


def closed(one: MeasuredSet, seed: int) -> dict[str, Any]:
    """What is found in a set."""
    rig, began = parse_rig(dict(one.rig)), time.process_time()
    train, held = ([one.read(rig, name) for name in names] for names in (one.train, one.held_out))
    finding, _ = close(rig, train, held, lambda *_: None, seed=seed)
    found = dict(finding.calibration)
    for effect in finding.effects:
        found |= {f"{effect.id}.{name}": estimate for name, estimate in effect.parameters.items()}
    classes = {effect.id: [effect.id, *effect.equivalent] for effect in finding.effects}
    wrong = [name for name, like in classes.items() if set(like) <= set(one.cannot)]
    for name, (low, high) in one.truth.items():
        estimate = found.get(name)
        if estimate is None or estimate.ci95[0] > high or estimate.ci95[1] < low:
            wrong.append(f"{name} for {low:g} to {high:g}")
    error = finding.error["holdout" if held else "train"]
    return {
        "verdict": finding.verdict,
        "effects": [" or ".join(like) for like in classes.values()],
        "numbers": {name: [estimate.value, *estimate.ci95] for name, estimate in found.items()},
        "error": error,
        "unit": finding.error_unit,
        "plain": one.plain,
        "times": error["augmented"] / one.plain,
        "wrong": wrong,
        "failed": [check.id for check in finding.checks if not check.ok],
        "processor_seconds": round(time.process_time() - began, 1),
    }


def line(name: str, row: Mapping[str, Any]) -> str:
    errors = ", ".join(f"{stage} {value:.4g}" for stage, value in row["error"].items())
    return (
        f"{name}: {row['verdict']}, {', '.join(row['effects']) or 'no effect'}; {errors} {row['unit']}; plain"
        f" {row['plain']:.4g}, times {row['times']:.3g}; wrong: {', '.join(row['wrong']) or 'nothing'}"
    )


def main() -> None:
    """Print the rows, and keep them as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", default=[*SETS])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows: dict[str, Any] = {}
    if options.out and options.out.exists():
        rows = read_json(options.out, "file of measured sets", 1 << 24)
    for name in options.sets:
        if name not in rows:
            rows[name] = closed(SETS[name], options.seed)
            if options.out:
                options.out.write_text(json.dumps(rows, indent=1))
        print(line(name, rows[name]), flush=True)


if __name__ == "__main__":
    main()
