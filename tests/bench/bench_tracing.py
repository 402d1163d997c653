"""How often the loop names the hidden effect: simulated series with one effect nobody declared, and series without any.

`python -m tests.bench.bench_tracing --out DIR [--kind pull] [--effects a b a+b] [--pairs] [--seeds 1 2] [--none 5]`
runs `capsule close-loop` on the plant's series (`a+b` hides both; `--pairs` those of `PAIRS`), keeps one JSON line a
series (finished ones are not repeated) and prints the table that docs/results quote; `bench_augmented` with the same
DIR takes the models from there. "0.1 %" is what the model found leaves of its own held-out prediction, without noise,
where its base numbers are 0.1 % off: what a fit that good would leave. With `--truth` every series in DIR is fitted
once more, with the model that was found but from the plant's own base numbers on: what more luck in the search could
gain.
"""

import argparse
import contextlib
import io
import itertools
import json
import tomllib
from pathlib import Path
from typing import Any, Final

import numpy as np

from hil.app.main import run as capsule
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.kinds.series.series import SeriesKind
from models.identification.model import read_model
from models.records.record import Record, read_record
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.plant.series import answer_of, hidden_ids, make_series, published

TRAIN: Final = ("train_1", "train_2", "train_3")
EFFECTS: Final[dict[str, tuple[str, ...]]] = {
    "pull": (
        "stribeck",
        "viscous_drag",
        "directional_asymmetry",
        "fold_periodic",
        "lumen_taper",
        "stenosis",
        "peristaltic_wave",
        "stress_relaxation",
        "tissue_drying",
        "string_compliance",
        "wall_viscosity",
        "carriage_backlash",
        "nose_asymmetry",
        "film_weakening",
        "slip_folds",
    ),
    "magnetic": (
        "stribeck",
        "directional_asymmetry",
        "fold_periodic",
        "lumen_taper",
        "stenosis",
        "peristaltic_wave",
        "tissue_drying",
        "incline_gravity",
        "coupling_fade",
        "actuator_lag",
        "carriage_backlash",
        "viscous_drag",
        "sensor_delay",
        "nose_asymmetry",
        "film_weakening",
        "slip_folds",
    ),
    "coil": (
        "stribeck",
        "directional_asymmetry",
        "fold_periodic",
        "lumen_taper",
        "stenosis",
        "tissue_drying",
        "incline_gravity",
        "coupling_fade",
        "actuator_dead_zone",
        "actuator_saturation",
        "viscous_drag",
    ),
    "coil_voltage": (
        "directional_asymmetry",
        "fold_periodic",
        "tissue_drying",
        "incline_gravity",
        "actuator_lag",
        "actuator_dead_zone",
        "viscous_drag",
        "back_emf",
    ),
    "vibro": (
        "spring_damping",
        "end_stop_impact",
        "stribeck",
        "directional_asymmetry",
        "fold_periodic",
        "lumen_taper",
        "tissue_drying",
        "viscous_drag",
        "driver_lag",
        "spring_stiffening",
        "guide_rubbing",
        "coil_field",
    ),
    "vibro_plate": (
        "spring_damping",
        "end_stop_impact",
        "stribeck",
        "directional_asymmetry",
        "fold_periodic",
        "driver_lag",
    ),
}

PAIRS: Final[dict[str, tuple[str, ...]]] = {
    "pull": (
        "fold_periodic+tissue_drying",
        "peristaltic_wave+stribeck",
        "stenosis+carriage_backlash",
        "directional_asymmetry+viscous_drag",
        "lumen_taper+sensor_delay",
    ),
    "magnetic": (
        "fold_periodic+tissue_drying",
        "stenosis+carriage_backlash",
        "incline_gravity+fold_periodic",
        "actuator_lag+directional_asymmetry",
        "tissue_drying+sensor_delay",
    ),
}


def learned(kind: str, effect: str | None, seed: int, out: Path) -> Path:
    """The folder with a series and what `capsule close-loop` made of it."""
    folder = out / f"{kind}_{effect}_{seed}"
    if not (folder / "model.toml").exists():
        make_series(kind, effect, seed, folder)
    close_series(folder, folder)
    return folder


def close_series(folder: Path, out: Path) -> None:
    """`capsule close-loop` on the series in `folder`, where `out` does not hold a model yet."""
    if (out / "model.toml").exists():
        return
    records = [str(folder / f"{name}.csv.gz") for name in TRAIN]
    words = [
        "--rig",
        str(folder / "rig.toml"),
        "--out",
        str(out),
        "--holdout",
        str(folder / "holdout.csv.gz"),
        "--json",
    ]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
        status = capsule(["close-loop", *records, *words])
    if status != 0:
        raise RuntimeError(f"close-loop refused {folder}: {said.getvalue()}")


def run(kind: str, effect: str | None, seed: int, out: Path) -> dict[str, Any]:
    """One series made, closed and judged."""
    folder = learned(kind, effect, seed, out)
    model_kind, _, holdout, theta = read_series(folder, folder)
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    allowed = {e["id"]: [e["id"], *e["equivalent"]] for e in report["effects"]}
    ids = hidden_ids(effect)
    classes = list(allowed.values())[: len(ids)]
    if not ids:
        right = report["verdict"] == "none"
    elif all(published(name) for name in ids):
        right = all(any(answer_of(name) in some and len(some) <= 3 for some in classes) for name in ids)
    else:  # nothing in the catalogue is it
        right = report["verdict"] == "unknown"
    return {
        "kind": kind,
        "effect": effect,
        "seed": seed,
        "verdict": report["verdict"],
        "classes": allowed,
        "right": right,
        "holdout": report["error"]["holdout"],
        "floor": report["error"]["noise_floor"],
        "seconds": round(report["seconds"], 1),
        "thousandth": _a_thousandth_off(model_kind, theta, holdout),
        "truth": tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8")),
    }


def read_series(folder: Path, out: Path) -> tuple[SeriesKind, list[Record], list[Record], Theta]:
    """Of a series in `folder` closed into `out`: the kind, the training and the held-out records, and the model
    found.
    """
    rig = read_rig(folder / "rig.toml")
    train = [read_record(folder / f"{name}.csv.gz", rig) for name in TRAIN]
    kind = kind_for(rig, train)
    assert isinstance(kind, SeriesKind)
    return (
        kind,
        train,
        [read_record(folder / "holdout.csv.gz", rig)],
        read_model(out / "model.toml", kind.name).stages["augmented"],
    )


def _a_thousandth_off(kind: SeriesKind, theta: Theta, records: list[Record]) -> float:
    """Largest error of the model at `theta` held against itself, each fitted base number 0.1 % up or down."""
    made = [record.with_column(kind.quantity, kind.predict(record, theta)) for record in records]
    fitted = [p.name for p in kind.base if p.fit]
    errors = [
        kind.error(
            made,
            [kind.predict(r, theta | {n: theta[n] * f for n, f in zip(fitted, factors, strict=True)}) for r in made],
        )
        for factors in itertools.product((0.999, 1.001), repeat=len(fitted))
    ]
    return float(max(errors))


def main() -> None:
    """Run what is missing, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kind", choices=tuple(EFFECTS), action="append")
    parser.add_argument("--effects", nargs="*")
    parser.add_argument("--pairs", action="store_true", help="two effects at a time")
    parser.add_argument("--seeds", nargs="*", type=int, default=[1, 2])
    parser.add_argument("--none", type=int, default=0)
    parser.add_argument("--truth", action="store_true")
    arguments = parser.parse_args()
    ledger = arguments.out / "results.jsonl"
    arguments.out.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in ledger.read_text().splitlines()] if ledger.exists() else []
    done = {(r["kind"], r["effect"], r["seed"]) for r in rows}
    wanted: list[tuple[str, str | None, int]] = []
    effects = PAIRS if arguments.pairs else EFFECTS
    for kind in arguments.kind or list(effects):
        wanted += [
            (kind, e, s)
            for s in arguments.seeds
            for e in (arguments.effects if arguments.effects is not None else effects[kind])
        ]
        wanted += [(kind, None, 100 + s) for s in range(arguments.none)]
    for task in wanted:
        if task in done:
            continue
        row = run(*task, arguments.out)
        rows.append(row)
        with ledger.open("a") as file:
            file.write(json.dumps(row) + "\n")
        print(_line(row), flush=True)
    _summary(rows)
    if arguments.truth:
        for row in rows:
            print(
                f"{row['kind']:9} {row['effect']!s:22} seed {row['seed']:<4} {_from_the_truth(row, arguments.out)}",
                flush=True,
            )


def _from_the_truth(row: dict[str, Any], out: Path) -> str:
    folder = out / f"{row['kind']}_{row['effect']}_{row['seed']}"
    kind, train, holdout, found = read_series(folder, folder)
    start = found | {name: value for name, value in row["truth"].items() if name in found}
    fitter = Fitter.of(kind, train, sorted(found.effects))
    end = fitter.exactly(fitter.near(start).theta)
    floors = [
        kind.error(holdout, [kind.predict(r, theta) for r in holdout]) / row["floor"]
        for theta in (found, found | end.theta)
    ]
    return f"found {floors[0]:.2f} floors, from the true base numbers {floors[1]:.2f}"


def _line(row: dict[str, Any]) -> str:
    errors = row["holdout"]
    ratio = errors["augmented"] / row["floor"]
    return (
        f"{row['kind']:9} {row['effect']!s:22} seed {row['seed']:<4} {'right' if row['right'] else 'WRONG':6}"
        f" {row['verdict']:8} {row['classes']} {errors['nominal']:.3g} -> {errors['calibrated']:.3g} ->"
        f" {errors['augmented']:.3g} ({ratio:.2f} x floor; 0.1 % off {row['thousandth']:.3g}) {row['seconds']} s"
    )


def _summary(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        print(_line(row))
    acted = [r for r in rows if r["effect"] is not None]
    free = [r for r in rows if r["effect"] is None]
    print(
        f"named right: {sum(bool(r['right']) for r in acted)} of {len(acted)}; nothing named where nothing is: "
        f"{sum(bool(r['right']) for r in free)} of {len(free)}; median seconds"
        f" {np.median([r['seconds'] for r in rows]):.0f}"
    )


if __name__ == "__main__":
    main()
