"""Does a model that close-loop improved control better? Per hidden effect, same truth, same controller, three stages of
one model file.

`python -m tests.bench.bench_augmented --out DIR [--effects a b] [--seeds 2] [--controllers feedforward mpc]` makes a
series of a magnetic rig with the hidden effect, runs `capsule close-loop` on it, then tracks a slow sine on the same
rig with the nominal, the calibrated and the augmented model. One JSON line a run in DIR/runs.jsonl; finished ones are
not repeated.
"""

import argparse
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from controller.limits import Limits
from hil.app.scenario.reference import Sine
from hil.app.scenario.scenario import Control, TrackScenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.laws.geometry import Tissue
from models.rigs.reader import read_rig
from plant.drives import TrueMagnet
from plant.rig import Truth
from plant.session import Instruments
from tests.bench.bench_tracing import EFFECTS, learned

SECONDS: Final = 21.0
NOISES: Final = (1, 2, 3)
Row = dict[str, Any]


def scenario(effect: str, folder: Path) -> TrackScenario:
    """Out and back by 12 mm within 20 s on the series' own rig, as the answer file tells it to the plant alone."""
    answer = tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    numbers = {name: value for name, value in answer["parameters"].items() if name not in ("form", "published")}
    truth = Truth(
        drive=TrueMagnet(answer["magnet_stiffness_N_per_m"], TrueMagnet().magnet_range_m),
        tissue=Tissue(friction_coefficient=answer["friction_coefficient"]),
        hoop_factor=answer["hoop_stress_factor"],
        hidden={effect: numbers},
    )
    path = Sine(amplitude_mm=12.0, frequency_Hz=0.05).trajectory(SECONDS)
    belief = read_rig(folder / "rig.toml")
    return TrackScenario(effect, SECONDS, 1, "magnetic", truth, Instruments(), belief, path, Limits(), Control())


def rows(effect: str, seed: int, folder: Path, controllers: list[str], done: set[tuple[Any, ...]]) -> Iterator[Row]:
    """One row a run that is not done yet."""
    model, here = read_model(folder / "model.toml", "magnetic"), scenario(effect, folder)
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    found = [e["id"] for e in report["effects"]]
    for stage in STAGES:
        believed = believed_model(here, model.believed(stage))
        for controller in controllers:
            for noise in NOISES:
                if (effect, seed, stage, controller, noise) not in done:
                    result = score(here, run_loop(here, believed, controller, noise))
                    yield {
                        "effect": effect, "seed": seed, "stage": stage, "controller": controller, "noise": noise,
                        "found": found, "holdout": report["error"]["holdout"], "rmse_mm": 1e3 * result.tracking_rmse_m,
                        "wall_mN": 1e3 * result.wall_force_max_N, "violations": result.hard_violations,
                    }  # fmt: skip


def table(found: list[Row]) -> None:
    """A line an effect and controller: median RMSE by stage, and how many times the augmented model's is lower than the
    calibrated one's.
    """
    print(
        f"{'effect':22s} {'seed':4s} {'controller':12s} {'nominal':>8s} {'calibr.':>8s} {'augm. mm':>8s} {'ratio':>6s} "
        " named"
    )
    for effect, seed, controller in dict.fromkeys((r["effect"], r["seed"], r["controller"]) for r in found):
        runs = [r for r in found if (r["effect"], r["seed"], r["controller"]) == (effect, seed, controller)]
        rmse = [float(np.median([r["rmse_mm"] for r in runs if r["stage"] == stage] or [np.nan])) for stage in STAGES]
        numbers = " ".join(f"{value:8.3f}" for value in rmse)
        print(
            f"{effect:22s} {seed:4d} {controller:12s} {numbers} {rmse[1] / rmse[2]:6.2f} "
            f" {', '.join(runs[0]['found']) or '-'}"
        )


def main() -> None:
    """Run what is missing, then print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--effects", nargs="*", default=list(EFFECTS["magnetic"]))
    options.add_argument("--seeds", nargs="*", type=int, default=[2])
    options.add_argument("--controllers", nargs="*", default=["pid_friction", "feedforward", "mpc"])
    chosen = options.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    ledger = chosen.out / "runs.jsonl"
    found: list[Row] = [json.loads(line) for line in ledger.read_text().splitlines()] if ledger.exists() else []
    done = {(r["effect"], r["seed"], r["stage"], r["controller"], r["noise"]) for r in found}
    for seed in chosen.seeds:
        for effect in chosen.effects:
            folder = learned("magnetic", effect, seed, chosen.out)
            for row in rows(effect, seed, folder, chosen.controllers, done):
                found.append(row)
                with ledger.open("a") as file:
                    file.write(json.dumps(row) + "\n")
            table([r for r in found if (r["effect"], r["seed"]) == (effect, seed)])
    table(found)


if __name__ == "__main__":
    main()
