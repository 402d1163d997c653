"""The monitor: how long it is silent while the model holds, and how soon it finds that it does not.

`python -m tests.bench.bench_monitor --out FILE.jsonl [--kinds magnetic coil vibro] [--first 0] [--guts 20] [--seconds
120] [--tick-ms 2] [--effects none fold_periodic ...] [--sizes 0.5 1]` drives to and fro through guts that differ in
stiffness, friction and, by a few percent, from place to place; effects begin half way through. Each run is a line of
FILE, with all that the monitor saw; finished ones are not repeated. `--table` prints what the lines of FILE come to
with the thresholds of today. Thresholds are set on guts from 100 on (`--first 100`) and judged on those from 0 on.
"""

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from controller.estimator.base import trusting
from controller.monitor import Forecast, Health, Monitor, Second
from hil.app.scenario.reference import Steps
from hil.app.scenario.scenario import TrackScenario, load_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.theta import Theta
from plant.anatomy import Anatomy, random_anatomy
from plant.hidden.registry import hidden
from plant.rig import Truth

FOLDER: Final = Path(__file__).parents[2] / "hil" / "scenarios"
RIGS: Final = {
    "magnetic": ("magnetic_ramp", "feedforward", 24.0, 1.5),
    "coil": ("coil_ramp_2", "feedforward", 24.0, 2.0),
    "vibro": ("vibro_gut", "vibro", 60.0, 8.0),
}
"""Scenario, controller, how far in mm and how fast in mm/s to and fro."""
EFFECTS: Final = (
    "fold_periodic", "stenosis", "carriage_backlash", "actuator_lag", "sensor_delay", "coupling_fade", "tissue_drying",
    "incline_gravity", "directional_asymmetry", "peristaltic_wave",
)  # fmt: skip
UNEVEN: Final = 0.04
Row = dict[str, Any]


def gut(scenario: TrackScenario, seed: int) -> Truth:
    """Stiffness and friction up to 12 % off, a level that varies by `UNEVEN`, no narrow place: that is an effect."""
    rng, number = np.random.default_rng(1000 + seed), seed
    level: Anatomy = random_anatomy(number, spread=UNEVEN)
    while max(level.level) > 1.25 * float(np.median(level.level)):
        number += 1000
        level = random_anatomy(number, spread=UNEVEN)
    hoop, friction = rng.uniform(0.88, 1.12, 2)
    tissue = replace(scenario.truth.tissue, friction_coefficient=0.082 * friction)
    return replace(scenario.truth, anatomy=level, hoop_factor=hoop, tissue=tissue)


def numbers(effect: str, size: float, onset_s: float) -> dict[str, dict[str, float]]:
    """`effect` with `size` times the middle of its range, from `onset_s` on; nothing for "none"."""
    if effect == "none":
        return {}
    amplitude = hidden(effect).numbers[0]
    more = {"centre_m": 12e-3} if effect == "stenosis" else {}
    return {effect: {amplitude.name: size * amplitude.middle, "onset_s": onset_s, **more}}


def drive(kind: str, effect: str, size: float, seed: int, seconds: float, tick_s: float) -> Row:
    """One run and what the monitor saw of it."""
    name, controller, far, speed = RIGS[kind]
    plain = load_track_scenario(FOLDER / f"track_{name}.toml")
    way = far / speed + 1.0
    places = tuple(far * (k % 2 == 0) for k in range(int((seconds - 1) / way)))
    path = Steps(positions_mm=places, speed_mm_s=speed).trajectory(seconds)
    rig = replace(gut(plain, seed), hidden=numbers(effect, size, 0.5 * seconds))
    control = replace(plain.control, tick_s=tick_s)
    scenario = replace(plain, duration_s=seconds, reference=path, truth=rig, control=control)
    seen: list[tuple[float, Second]] = []
    step = Forecast.step

    def kept(self: Forecast, now: float, *more: Any) -> Second | None:
        second = step(self, now, *more)
        if second is not None:
            seen.append((now, second))
        return second

    Forecast.step = kept  # type: ignore[assignment,method-assign]
    try:
        trace = run_loop(scenario, believed_model(scenario, Theta()), controller, seed)
    finally:
        Forecast.step = step  # type: ignore[method-assign]
    found = score(scenario, trace)
    return {
        "kind": kind, "effect": effect, "size": size, "seed": seed, "seconds": seconds, "tick_s": tick_s,
        "lost": found.ticks["lost"],
        "rmse_mm": 1e3 * found.tracking_rmse_m, "monitor": found.monitor,
        "seen": [[round(now, 3), *(float(f"{v:.5g}") for v in asdict(second).values())] for now, second in seen],
    }  # fmt: skip


def judged(row: Row, model: Any) -> tuple[Health, float, float]:
    """What the monitor would say of `row` with the thresholds of today, when, and the most evidence before."""
    monitor = Monitor(model)
    most = 0.0
    for now, *values in row["seen"]:
        monitor.judge(now, Second(*values[:3], int(values[3]), *values[4:]))
        if monitor.health.state == "broken":
            return monitor.health, now, most
        most = max(most, monitor.health.evidence)
    return monitor.health, math.inf, most


class Believer:
    """Stands for the estimator of a kind of rig."""

    offset = 0.0

    def __init__(self, kind: str) -> None:
        scenario = load_track_scenario(FOLDER / f"track_{RIGS[kind][0]}.toml")
        self.model = believed_model(scenario, Theta())
        self.noise = trusting(self.model)


def table(rows: list[Row]) -> Iterator[str]:
    """False alarms and how near the quiet runs came to one; then delays by effect and size."""
    for kind in dict.fromkeys(row["kind"] for row in rows):
        model = Believer(kind)
        quiet = [row for row in rows if (row["kind"], row["effect"]) == (kind, "none")]
        found = [judged(row, model) for row in quiet]
        alarms = sum(health.state == "broken" for health, _, _ in found)
        hours = sum(min(when, row["seconds"]) for row, (_, when, _) in zip(quiet, found, strict=True)) / 3600
        yield f"{kind}: {alarms} false alarms in {hours:.2f} h over {len(quiet)} guts; most evidence by gut: " + (
            ", ".join(f"{most:.2f}" for _, _, most in sorted(found, key=lambda f: -f[2])[:6])
        )
        for effect in EFFECTS:
            for size in sorted({row["size"] for row in rows if (row["kind"], row["effect"]) == (kind, effect)}):
                runs = [r for r in rows if (r["kind"], r["effect"], r["size"]) == (kind, effect, size)]
                verdicts = [(judged(row, model), 0.5 * row["seconds"]) for row in runs]
                early = sum(when < onset for (_, when, _), onset in verdicts)
                delays = [when - onset for (_, when, _), onset in verdicts if onset <= when < math.inf]
                ways = [health.change for (health, when, _), onset in verdicts if onset <= when < math.inf]
                words = f"{np.median(delays):5.1f} s ({max(delays):.1f})" if delays else "-"
                yield f"{effect:22s} {size:4.2g}  {len(delays)}/{len(runs)}  {words}  {early} early  {','.join(ways)}"


def main() -> None:
    """Run what is missing, or print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--kinds", nargs="*", default=list(RIGS), choices=list(RIGS))
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--guts", type=int, default=20)
    options.add_argument("--seconds", type=float, default=120.0)
    options.add_argument("--tick-ms", type=float, default=2.0)
    options.add_argument("--effects", nargs="*", default=["none"], choices=["none", *EFFECTS])
    options.add_argument("--sizes", nargs="*", type=float, default=[1.0])
    options.add_argument("--table", action="store_true")
    chosen = options.parse_args()
    lines = chosen.out.read_text().splitlines() if chosen.out.exists() else []
    rows: list[Row] = [json.loads(line) for line in lines]
    done = {(r["kind"], r["effect"], r["size"], r["seed"]) for r in rows}
    if chosen.table:
        print("\n".join(table(rows)))
        return
    for seed in range(chosen.first, chosen.first + chosen.guts):
        for kind in chosen.kinds:
            for effect in chosen.effects:
                for size in chosen.sizes if effect != "none" else [0.0]:
                    able = effect == "none" or kind in hidden(effect).drives
                    if able and (kind, effect, size, seed) not in done:
                        with chosen.out.open("a") as file:
                            file.write(
                                json.dumps(drive(kind, effect, size, seed, chosen.seconds, 1e-3 * chosen.tick_ms))
                                + "\n"
                            )


if __name__ == "__main__":
    main()
