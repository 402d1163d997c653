"""How a closed loop on the measured capsubot generalises: random thirds of its conditions held out, the loop's own
search on the rest.

`python -m tests.bench.bench_capsubot [--draws 12] [--nested 2] [--seed 0] [--out FILE]` closes the loop on all
conditions once, then holds out thirds of the conditions: for the effects that the whole table names, the held-out error
of models with the first one, two, ... of them (their fits start from the whole table's values; random starts end there
too); with `--nested` also the search done anew on the two thirds, so that the choice of effects is not made on what is
held out.
"""

import argparse
import json
import os
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from models.identification import close
from models.identification.fitting.fitter import Fitter
from models.identification.kinds.vibro_table import VibroTableKind
from models.identification.settings import SET
from models.records.record import Record, read_record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.theta import Theta

SHARED = Path(os.environ.get("CAPSULE_SHARED", Path(__file__).parents[3] / "shared"))
RIG = {
    "capsule": {"mass_kg": 0.193},
    "drive": {"inner_mass_kg": 0.074, "spring_stiffness_N_per_m": 256.23, "force_N": 1.25, "reaction_on_body": True},
    "surface": {"kind": "plate", "friction_coefficient": 0.29},
    "rig": {"kind": "vibro_table"},
}


def third(record: Record, draw: int) -> tuple[Record, Record]:
    """The record without a random third of its (period, duty), and that third."""
    pairs, index = np.unique(np.column_stack((record["period_s"], record["duty"])), axis=0, return_inverse=True)
    held = (np.random.default_rng(draw).permutation(len(pairs)) < len(pairs) // 3)[index.ravel()]
    return record.rows(~held), record.rows(held)


def ladder(kind: VibroTableKind, theta: Theta, effects: Sequence[str], rest: Record, held: Record) -> list[float]:
    """Held-out rms in mm/s of fits to `rest` with none, the first, the first two ... of `effects`."""
    out = []
    for count in range(len(effects) + 1):
        some = list(effects[:count])
        start = theta.only(some)
        fit = start | Fitter.of(kind, [rest], some, 0).near(start, SET.narrow).theta
        out.append(1e3 * kind.error([held], [kind.predict(held, fit)]))
    return out


def closed(rig: Rig, rest: Record, held: Sequence[Record], seed: int) -> tuple[dict[str, object], Theta]:
    """One closed loop in numbers, and its model's values."""
    began, cpu = time.monotonic(), time.process_time()
    finding, model = close(rig, [rest], held, lambda *_: None, seed=seed)
    numbers = {
        "verdict": finding.verdict,
        "effects": [e.id for e in finding.effects],
        "equivalent": {e.id: list(e.equivalent) for e in finding.effects},
        "gains": [round(e.evidence, 3) for e in finding.effects],
        "error_mm_s": {
            part: {k: round(1e3 * v, 2) for k, v in errors.items()} for part, errors in finding.error.items()
        },
        "said": [s for s in finding.statements if s.startswith(("Cross-validated", "The augmented"))],
        "seconds": round(time.monotonic() - began, 1),
        "processor_seconds": round(time.process_time() - cpu, 1),
    }
    return numbers, model.stages["augmented"]


def main() -> None:
    """Close the loop on the whole table, then on two thirds of it again and again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=12)
    parser.add_argument("--nested", type=int, default=0, help="how many of the draws are searched anew")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rig = parse_rig(RIG)
    record = read_record(SHARED / "data" / "capsubot" / "mean_velocity.csv", rig)
    whole, theta = closed(rig, record, [], options.seed)
    print(json.dumps(whole, indent=1), flush=True)
    kind = VibroTableKind.from_rig(rig).settled([record])
    effects = list(theta.effects)
    rows = np.array([ladder(kind, theta, effects, *third(record, draw)) for draw in range(options.draws)])
    for count, column in enumerate(rows.T):
        q = np.percentile(column, [0, 25, 50, 75, 100])
        print(
            f"{count} effects: held-out rms mm/s mean {column.mean():.2f}, quartiles "
            + " ".join(f"{v:.2f}" for v in q),
            flush=True,
        )
    again = []
    for draw in range(options.nested):
        rest, held = third(record, draw)
        again.append(closed(rig, rest, [held], options.seed)[0])
        print(json.dumps(again[-1]), flush=True)
    if options.out:
        options.out.write_text(json.dumps({"whole": whole, "ladder_mm_s": rows.tolist(), "nested": again}, indent=1))


if __name__ == "__main__":
    main()
