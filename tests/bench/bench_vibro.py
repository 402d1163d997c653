"""Vibro drive: what it reaches, how soon the mean speed is right, and energy for a way of square, four-phase and
optimal cycles.

`python -m tests.bench.bench_vibro [--out DIR] [--plants N]` prints the tables and writes them to DIR/vibro.json.
"""

import argparse
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from controller.vibro.controller import VibroController
from controller.vibro.cycles import Cycles, Gait, VibroModel, impact_of
from controller.vibro.drive_map import design, designed, speed_map, squares
from controller.vibro.gears import DriveMap
from controller.vibro.slow_loop import Tuning
from controller.vibro.waveform import Waveform
from models.identification.model import Model
from models.laws.geometry import Capsule, Tissue
from models.surfaces.gut import Wall
from models.theta import Theta
from plant.drives import TrueVibro
from plant.rig import Truth
from tests.bench.four_phase import best_four_phase
from tests.bench.least_energy import cheapest, optima
from tests.controller.vibro.vibro_runs import (
    Steady,
    believed,
    drive_plant,
    gut_model,
    gut_plant,
    plate_model,
    plate_plant,
)
from tests.places import CAPSUBOT_MODEL

SPEEDS_M_S = tuple(sign * v for sign in (1, -1) for v in (2e-3, 5e-3, 10e-3, 20e-3))
SECONDS = 9.0
WRONG = 0.15
IDENTIFIED = CAPSUBOT_MODEL
Row = dict[str, Any]
# of the square waves, finer than the design's
RATIOS = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.35, 1.5, 1.7, 1.9, 2.1, 2.4)
DUTIES = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9)
AMPLITUDES = (0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.8, 1.0)


def energies() -> list[Row]:
    """J/m = mJ/mm on the gut at each speed: electrical with the motor constant of `cycles`, and the coil's mechanical
    work; square and optimal cycles by the stop that they strike, `chosen` the cheapest of all and its share of the best
    fixed square wave's energy.
    """
    cycles = Cycles(gut_model())
    table = speed_map(cycles, RATIOS, DUTIES, AMPLITUDES)
    phases = best_four_phase(cycles, SPEEDS_M_S)
    rows: list[Row] = []
    optimal: list[Waveform] = []
    for v in sorted(SPEEDS_M_S, key=lambda v: (v < 0, -abs(v))):
        plain = squares(cycles, table, v)
        guesses = [w for one in plain for w in (one.waveform, one.waveform.flipped())]
        better = optima(cycles, v, [*guesses, *(w.flipped() for w in optimal[:1]), *optimal[-1:]])
        row: Row = {"speed_mm_s": 1e3 * v}
        for one in plain + better:
            row[f"{one.shape}, impact {one.impact}"] = _said(one.waveform, one.gait)
        if (found := phases[v]) is not None:
            row["four-phase"] = _said(*found) | {"impact": impact_of(cycles.model, found[1])}
        chosen, square = cheapest(plain + better), cheapest(plain)
        if chosen is not None:
            share = None if square is None else round(chosen.gait.energy_J_per_m / square.gait.energy_J_per_m, 3)
            row["chosen"] = {"shape": chosen.shape, "impact": chosen.impact, "of_square": share}
            optimal += [chosen.waveform] if chosen.shape == "optimal" else []
        rows.append(row)
    return rows


def _said(wave: Waveform, gait: Gait) -> Row:
    return {
        "J_per_m": round(gait.energy_J_per_m, 2),
        "work_J_per_m": round(gait.work_W / abs(gait.speed_m_s), 3),
        "speed_mm_s": round(1e3 * gait.speed_m_s, 2),
        "period_ms": round(1e3 * wave.period_s, 1),
    }


def loop(drive: DriveMap, plants: Mapping[str, Truth], feedback: bool = True, mirror: float = 1.0) -> list[Row]:
    """A run for each speed and plant: mean speed after 3 s against the commanded one, and when it had come within 10 %
    for good.
    """
    rows = []
    for v in SPEEDS_M_S:
        for seed, (name, rig) in enumerate(plants.items()):
            run = drive_plant(VibroController(drive, Tuning(feedback=feedback)), rig, Steady(v), SECONDS, seed + 100)
            error = run.mean_speed(3.0) / v - 1
            settled = run.settled_s(v)
            ticks = {"p50": 1e3 * float(np.median(run.tick_s)), "p99": 1e3 * float(np.quantile(run.tick_s, 0.99))}
            rows.append({"speed_mm_s": 1e3 * v, "plant": name, "error": error, "settled_s": settled, "tick_ms": ticks})
    return rows


def wrong_plants(n: int) -> dict[str, Truth]:
    """The nominal plant and `n` with spring, force, hoop stress and friction off by up to 15 % each, drawn once."""
    rng = np.random.default_rng(7)
    drawn = [
        dict(zip(("spring", "force", "hoop", "mu"), rng.uniform(1 - WRONG, 1 + WRONG, 4), strict=True))
        for _ in range(n)
    ]
    return {"nominal": gut_plant()} | {f"plant {k}": gut_plant(**off) for k, off in enumerate(drawn)}


def reaches() -> dict[str, Row]:
    """How fast each rig's model goes both ways by its map of squares."""
    wall, light = Wall.around(Capsule(), Tissue()), Wall.around(Capsule(mass_kg=1.67e-3), Tissue())
    rigs: dict[str, VibroModel] = {
        "shipped gut rig": gut_model(),
        "default drive (74 g, 1.25 N) in the gut": believed(TrueVibro(), wall),
    }
    for force in (0.06, 0.12, 0.25, 0.5):
        rigs[f"1.8 g in 1.67 g, 62 N/m, {1e3 * force:.0f} mN, gut"] = believed(
            TrueVibro(1.8e-3, 62.0, 0.0156, force), light
        )
    rigs["capsubot on its plate"] = plate_model()
    rigs["capsubot identified"] = plate_model(_identified())
    found = {}
    for name, model in rigs.items():
        low, high = (designed(model) if name == "shipped gut rig" else design(model, optimise=False)).reach()
        found[name] = {"backward_mm_s": round(1e3 * low, 1), "forward_mm_s": round(1e3 * high, 1)}
    return found


def _identified() -> Theta:
    values = Model.from_toml(IDENTIFIED.read_text(encoding="utf-8")).stages["augmented"]
    return values | {"mirror": 1.0}


def capsubot() -> dict[str, list[Row]]:
    """A plant like the identified capsubot, whose damping has the plant's own form, under the nominal and the
    identified model.
    """
    rig = plate_plant(286.5 / 256.23, 3.16 / 1.25, 0.6647 / 0.29, {"spring_damping": {"damping_N_s_per_m": 2.349}})
    maps = {
        "nominal model": designed(plate_model(), False),
        "identified model": designed(plate_model(_identified()), False),
    }
    return {name: loop(drive, {"capsubot": rig}) for name, drive in maps.items()}


def summary(rows: list[Row]) -> list[Row]:
    """Over the plants, a row a speed."""
    out = []
    for v in sorted({r["speed_mm_s"] for r in rows}):
        own = [r for r in rows if r["speed_mm_s"] == v]
        errors = np.abs([r["error"] for r in own])
        settled = np.array([r["settled_s"] for r in own])
        out.append(
            {
                "speed_mm_s": v,
                "runs": len(own),
                "within_10_percent": int((errors <= 0.1).sum()),
                "settled_in_3_s": int((settled <= 3.0).sum()),
                "median_error": round(float(np.median(errors)), 4),
                "worst_error": round(float(errors.max()), 4),
                "median_settled_s": _finite(float(np.median(settled))),
                "worst_settled_s": _finite(float(settled.max())),
            }
        )
    return out


def _finite(value: float) -> float | None:
    return round(value, 2) if math.isfinite(value) else None


def main() -> None:
    """Run everything, print and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/bench_vibro"))
    parser.add_argument("--plants", type=int, default=8)
    given = parser.parse_args()
    drive = designed(gut_model())
    runs = loop(drive, wrong_plants(given.plants))
    found: dict[str, Any] = {"closed loop": summary(runs)}
    _show("closed loop on the gut, all speeds, plants off by up to 15 %", found["closed loop"])
    found["feedforward alone"] = summary(loop(drive, wrong_plants(given.plants), feedback=False))
    _show("feedforward alone", found["feedforward alone"])
    found["tick_ms"] = {key: float(np.median([r["tick_ms"][key] for r in runs])) for key in ("p50", "p99")}
    found["energy"] = energies()
    for row in found["energy"]:
        print(json.dumps(row))
    found["reach"] = reaches()
    for name, row in found["reach"].items():
        print(name, json.dumps(row))
    found["capsubot"] = {name: summary(rows) for name, rows in capsubot().items()}
    for name, rows in found["capsubot"].items():
        _show(name, rows)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "vibro.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def _show(title: str, rows: list[Row]) -> None:
    print(title)
    for row in rows:
        print("  " + json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
