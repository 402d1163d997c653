"""How often the loop names the hidden effect: simulated series with one effect nobody declared, and series without any.

`python -m tests.bench.bench_tracing --out DIR [--kind pull] [--effects a b] [--seeds 1 2] [--none 5]` runs the plant's series through
`close`, keeps one JSON line a series (finished ones are not repeated) and prints the table that README quotes. "a thousandth" is what the
model found leaves of its own held-out prediction, without noise, where its base numbers are 0.1 % off: what a fit that good would leave.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
import tomllib
from pathlib import Path

import numpy as np

from models.identification import close
from models.identification.kinds import kind_for
from models.record import Record, read_record
from models.rig import read_rig
from plant.series import make_series

EFFECTS = {
    "pull": (
        "stribeck", "viscous_drag", "directional_asymmetry", "fold_periodic", "lumen_taper", "stenosis", "peristaltic_wave",
        "stress_relaxation", "tissue_drying", "string_compliance", "wall_viscosity", "carriage_backlash",
    ),
    "magnetic": (
        "stribeck", "directional_asymmetry", "fold_periodic", "lumen_taper", "stenosis", "peristaltic_wave", "tissue_drying",
        "incline_gravity", "coupling_fade", "actuator_lag", "carriage_backlash", "viscous_drag",
    ),
    "coil": (
        "stribeck", "directional_asymmetry", "fold_periodic", "lumen_taper", "stenosis", "tissue_drying", "incline_gravity",
        "coupling_fade", "actuator_lag", "actuator_dead_zone", "actuator_saturation", "viscous_drag",
    ),
    "vibro": (
        "spring_damping", "end_stop_impact", "stribeck", "directional_asymmetry", "fold_periodic", "lumen_taper", "incline_gravity",
        "tissue_drying", "viscous_drag",
    ),
    "vibro_plate": ("spring_damping", "end_stop_impact", "stribeck", "directional_asymmetry", "fold_periodic", "incline_gravity"),
}  # fmt: skip


def run(kind: str, effect: str | None, seed: int, out: Path) -> dict[str, object]:
    """One series made, closed and judged."""
    folder = make_series(kind, effect, seed, out / f"{kind}_{effect}_{seed}")
    rig = read_rig(folder / "rig.toml")
    train = [read_record(folder / f"train_{i}.csv.gz", rig) for i in (1, 2, 3)]
    holdout = [read_record(folder / "holdout.csv.gz", rig)]
    began = time.monotonic()
    finding, model = close(rig, train, holdout, lambda *_: None, seed=0)
    seconds = round(time.monotonic() - began, 1)
    named = [e.id for e in finding.effects]
    allowed = {i: [i, *e.equivalent] for i, e in zip(named, finding.effects, strict=True)}
    right = (
        (finding.verdict == "none" and not named)
        if effect is None
        else bool(named) and effect in allowed[named[0]] and len(allowed[named[0]]) <= 3
    )
    return {
        "kind": kind, "effect": effect, "seed": seed, "verdict": finding.verdict, "named": named, "classes": allowed, "right": right,
        "holdout": finding.error["holdout"], "floor": finding.noise_floor, "seconds": seconds,
        "thousandth": _a_thousandth_off(kind_for(rig, train), model.stages["augmented"], holdout),
        "gains": [(c.id, c.round, c.gain) for c in finding.candidates if c.gain is not None],
        "statement": finding.statements[0], "truth": tomllib.loads((folder / "answer.toml").read_text()),
    }  # fmt: skip


def _a_thousandth_off(kind, theta: dict[str, float], records: list[Record]) -> float:  # type: ignore[no-untyped-def]
    """Largest error of the model at `theta` held against itself, each fitted base number 0.1 % up or down."""
    made = [record.with_column(kind.quantity, kind.predict(record, theta)) for record in records]
    fitted = [p.name for p in kind.base if p.fit]
    errors = [
        kind.error(
            made, [kind.predict(r, {**theta, **{n: theta[n] * f for n, f in zip(fitted, factors, strict=True)}}) for r in made]
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
    parser.add_argument("--seeds", nargs="*", type=int, default=[1, 2])
    parser.add_argument("--none", type=int, default=0)
    arguments = parser.parse_args()
    ledger = arguments.out / "results.jsonl"
    arguments.out.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in ledger.read_text().splitlines()] if ledger.exists() else []
    done = {(r["kind"], r["effect"], r["seed"]) for r in rows}
    wanted: list[tuple[str, str | None, int]] = []
    for kind in arguments.kind or list(EFFECTS):
        wanted += [
            (kind, e, s) for s in arguments.seeds for e in (arguments.effects if arguments.effects is not None else EFFECTS[kind])
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


def _line(row: dict[str, object]) -> str:
    errors = row["holdout"]
    assert isinstance(errors, dict)
    ratio = errors["augmented"] / row["floor"]  # type: ignore[operator]
    return (
        f"{row['kind']:9} {row['effect']!s:22} seed {row['seed']:<4} {'right' if row['right'] else 'WRONG':6} {row['verdict']:8} "
        f"{row['classes']} {errors['nominal']:.3g} -> {errors['calibrated']:.3g} -> {errors['augmented']:.3g} "
        f"({ratio:.2f} x floor; a thousandth {row['thousandth']:.3g}) {row['seconds']} s"
    )


def _summary(rows: list[dict[str, object]]) -> None:
    for row in rows:
        print(_line(row))
    hidden = [r for r in rows if r["effect"] is not None]
    free = [r for r in rows if r["effect"] is None]
    print(f"named right: {sum(bool(r['right']) for r in hidden)} of {len(hidden)}; nothing named where nothing is: "
          f"{sum(bool(r['right']) for r in free)} of {len(free)}; median seconds {np.median([r['seconds'] for r in rows]):.0f}")  # type: ignore[arg-type]  # fmt: skip


if __name__ == "__main__":
    main()
