"""Learning while it runs: effects that begin at a time nobody declared, with and without `--learn`, over the bus.

`python -m tests.bench.bench_learning --out FILE.jsonl [--kinds magnetic coil] [--effects none fold_periodic ...]
[--seeds 1] [--size 1] [--noise 0.0002] [--speed 4] [--onset 30]` leads each rig to and fro over 18 mm through a gut
that differs from the nominal one in stiffness, friction and, by a few percent, from place to place. The effects are the
plant's own forms, with the middle of their ranges times `--size`; `A+B` one after the other (B begins 180 s after A,
and the run is as much longer). Each row is the same run twice, and a line of FILE; finished ones are not repeated.
`--table` prints what FILE holds. The table `[learning]` is that of `hil/scenarios/demo_learning.toml`; at a tenth of
its speed or with much more noise effects are harder to identify, and the learner should gather longer.

With `--given` nothing is learned: each run is driven once as it is believed and once by a model that has the gut's own
base and the effect's numbers from its beginning, which bounds what learning can reach.

Errors are rms of the capsule's true place against the reference: over the 25 s before the onset, and over the last
30 s, which end 180 s after the (last) onset, without and with learning. A run in which nothing was offered and nothing
driven is the run without learning, which is then not driven again.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from hil.app.learn.identify import answer_at_once
from hil.app.scenario.bus_scenario import SilScenario, load_sil_scenario
from hil.app.scenario.reference import Steps
from hil.app.scenario.scenario import load_track_scenario
from hil.app.sil.learning_page import error_by_second, rms_m
from hil.app.sil.loop import SilTrace, learning_of, run_sil
from hil.app.sil.testbed import believed_on_bus
from hil.app.track.score import score
from models.theta import Theta
from tests.bench.bench_monitor import FOLDER, RIGS, gut, numbers

EFFECTS: Final = (
    "fold_periodic", "coupling_fade", "incline_gravity", "directional_asymmetry", "tissue_drying", "actuator_lag",
    "carriage_backlash", "stenosis", "peristaltic_wave", "sensor_delay", "none", "fold_periodic+incline_gravity",
)  # fmt: skip
FAR_MM: Final = 18.0
DWELL_S: Final = 1.0
BEFORE_S: Final = 25.0
LAST_S: Final = 30.0
AFTER_S: Final = 180.0
TICK_S: Final = {"magnetic": 5e-3, "coil": 4e-3}
PACE: Final = load_sil_scenario(FOLDER / "demo_learning.toml")[0].learning
GIVEN: Final[dict[str, dict[str, float]]] = {
    "none": {},
    "actuator_lag": Theta.of({("actuator_lag", "time_s"): 0.11}),
    "sensor_delay": Theta.of({("sensor_delay", "delay_s"): 0.08}),
    "incline_gravity": Theta.of({("incline_gravity", "force_N"): 0.0162}),
    "carriage_backlash": Theta.of({("carriage_backlash", "width_m"): 1.75e-3}),
}
"""The catalogue's numbers of the plant's effects, where both have the same meaning."""
Row = dict[str, Any]


def conditions_of(options: argparse.Namespace) -> dict[str, float]:
    """What beside rig, effects and seed makes a row."""
    return {
        "size": options.size,
        "onset_s": options.onset,
        "noise_m": options.noise,
        "speed_mm_s": options.speed,
    }


def scenario_of(kind: str, effects: str, seed: int, options: argparse.Namespace) -> SilScenario:
    """The rig with the effects, led to and fro until `AFTER_S` after the last onset."""
    plain = load_track_scenario(FOLDER / f"track_{RIGS[kind][0]}.toml")
    named = effects.split("+")
    seconds = options.onset + AFTER_S * len(named)
    places = tuple(FAR_MM * (k % 2 == 0) for k in range(int((seconds - 1) / (FAR_MM / options.speed + DWELL_S))))
    hidden: dict[str, dict[str, float]] = {}
    for k, effect in enumerate(named):
        hidden |= numbers(effect, options.size, options.onset + AFTER_S * k)
    loop = replace(
        plain,
        duration_s=seconds,
        reference=Steps(positions_mm=places, speed_mm_s=options.speed, dwell_s=DWELL_S).trajectory(seconds),
        instruments=replace(plain.instruments, localisation=replace(plain.instruments.localisation, std=options.noise)),
        truth=replace(gut(plain, seed), hidden=hidden),
        control=plain.control.but(tick_s=TICK_S[kind]),
    )
    return SilScenario(loop, learning=PACE)


def led(scenario: SilScenario, controller: str, seed: int, learns: bool) -> tuple[SilTrace, Any]:
    """One run, and what it scores."""
    model = believed_on_bus(scenario, Theta())
    learning = learning_of(scenario, Theta(), answer_at_once) if learns else None
    trace = run_sil(scenario, model, controller, seed, learning=learning)
    return trace, score(scenario.loop, trace)


def rms_mm(trace: SilTrace, scenario: SilScenario, begin_s: float, end_s: float) -> float:
    """Rms error in mm of the true place from `begin_s` to `end_s`, whole seconds."""
    found = rms_m(*error_by_second(scenario, trace), begin_s, end_s)
    return float("nan") if found is None else 1e3 * found


def row_of(kind: str, effects: str, seed: int, options: argparse.Namespace) -> Row:
    """The same run without and with learning."""
    scenario, began = scenario_of(kind, effects, seed, options), time.monotonic()
    controller, onset_s = RIGS[kind][1], options.onset
    end = scenario.loop.duration_s
    row: Row = {"kind": kind, "effects": effects, "seed": seed, **conditions_of(options), "seconds": end}

    def scored(learns: bool) -> tuple[SilTrace, Row]:
        trace, found = led(scenario, controller, seed, learns)
        return trace, {
            "before_mm": rms_mm(trace, scenario, onset_s - BEFORE_S, onset_s),
            "after_mm": rms_mm(trace, scenario, end - LAST_S, end),
            "violations": found.hard_violations,
            "stopped": trace.stopped_because,
            "lessons": [lesson.document() for lesson in trace.lessons],
        }

    trace, row["with"] = scored(True)
    changed = trace.offers or trace.experiments_at
    row["without"] = scored(False)[1] if changed else row["with"]
    row["ratio"] = row["with"]["after_mm"] / row["without"]["after_mm"]
    row["wall_s"] = round(time.monotonic() - began, 1)
    return row


def given(kind: str, effects: str, seed: int, options: argparse.Namespace) -> str:
    """Errors over the last `LAST_S` as believed, and with the base and the effect known."""
    scenario = scenario_of(kind, effects, seed, options)
    rig, end, errors = scenario.loop.truth, scenario.loop.duration_s, []
    drive: Any = rig.drive
    base = {
        "hoop_stress_factor": float(rig.hoop_factor),
        "friction_coefficient": float(rig.tissue.friction_coefficient),
        **({"magnet_stiffness_N_per_m": drive.magnet_stiffness_N_per_m} if kind == "magnetic" else {}),
    }
    for believed in (Theta(), Theta.of({**base, **GIVEN[effects]})):
        trace = run_sil(scenario, believed_on_bus(scenario, believed), RIGS[kind][1], seed)
        errors.append(rms_mm(trace, scenario, end - LAST_S, end))
    return f"{kind:9s} {effects:30s} {seed:4d} {errors[0]:8.3f} {errors[1]:8.3f} {errors[1] / errors[0]:6.2f}"


def told(row: Row) -> str:
    """A row in words."""
    head = f"{row['kind']:9s} {row['effects']:30s} {row['size']:4g} {row['seed']:4d}"
    plain, learned = row["without"], row["with"]
    errors = f"{plain['before_mm']:8.3f} {plain['after_mm']:8.3f} {learned['after_mm']:8.3f} {row['ratio']:6.2f}"
    lines = [
        f"broken {one['broken_at_s']:.0f} s, {'+'.join(one['effects']) or 'nothing'} ({one['verdict'] or 'no answer'},"
        f" {one['searched_s']:.0f} s of search)"
        + (f", taken {one['taken_at_s']:.0f} s" if one["taken_at_s"] is not None else "")
        + (f", back {one['withdrawn_at_s']:.0f} s" if one["withdrawn_at_s"] is not None else "")
        for one in learned["lessons"]
    ]
    stops = "".join(f"; {name}: {row[name]['stopped']}" for name in ("without", "with") if row[name]["stopped"])
    broken = learned["violations"] + plain["violations"]
    return f"{head} {errors} {broken:4d} {row['wall_s']:6.0f}  {'; '.join(lines) or 'nothing learned'}{stops}"


def table(rows: Sequence[Row]) -> int:
    """Print the rows; 1 where a limit was broken or a model was taken where nothing is hidden."""
    print(
        f"{'rig':9s} {'effects':30s} {'size':>4s} {'seed':>4s} {'before':>8s} {'without':>8s} {'with':>8s} ratio  hard"
        "   wall  mm, s"
    )
    for row in rows:
        print(told(row))
    real = [row for row in rows if row["effects"] != "none"]
    switched = [r for r in rows if r["effects"] == "none" and any(x["taken_at_s"] for x in r["with"]["lessons"])]
    halved = sum(row["ratio"] <= 0.5 for row in real)
    nulls = len(rows) - len(real)
    broken = sum(row[name]["violations"] for row in rows for name in ("with", "without"))
    print(
        f"at most half the error: {halved} of {len(real)}; models taken where nothing is hidden: {len(switched)} of"
        f" {nulls}; hard limits broken: {broken}"
    )
    return int(bool(switched) or broken > 0)


def main() -> int:
    """Run what is not on file yet, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--given", action="store_true", help="the bound by a model that is right from the beginning")
    parser.add_argument("--kinds", nargs="*", default=["magnetic", "coil"], choices=["magnetic", "coil"])
    parser.add_argument("--effects", nargs="*", default=list(EFFECTS))
    parser.add_argument("--seeds", nargs="*", type=int, default=[1])
    parser.add_argument("--size", type=float, default=1.0, help="of the effects, times the middle of their ranges")
    parser.add_argument("--onset", type=float, default=30.0)
    parser.add_argument("--noise", type=float, default=2e-4, help="std of the localisation in m")
    parser.add_argument("--speed", type=float, default=4.0, help="of the reference in mm/s")
    parser.add_argument("--table", action="store_true", help="run nothing")
    options = parser.parse_args()
    if options.given:
        if options.size != 1:
            parser.error("--given knows the effects' numbers at --size 1 only")
        for kind, effects in [(k, e) for k in options.kinds for e in options.effects if e in GIVEN]:
            print(given(kind, effects, options.seeds[0], options), flush=True)
        return 0
    if options.out is None:
        parser.error("--out FILE.jsonl must be given where runs are kept")
    rows = [json.loads(line) for line in options.out.read_text().splitlines()] if options.out.exists() else []
    conditions = conditions_of(options)
    done = {(row["kind"], row["effects"], row["seed"]) for row in rows if conditions.items() <= row.items()}
    wanted = [(k, e, s) for k in options.kinds for s in options.seeds for e in options.effects]
    for kind, effects, seed in [] if options.table else wanted:
        if (kind, effects, seed) in done:
            continue
        rows.append(row_of(kind, effects, seed, options))
        with options.out.open("a") as file:
            file.write(json.dumps(rows[-1]) + "\n")
        print(told(rows[-1]), flush=True)
    return table(rows)


if __name__ == "__main__":
    sys.exit(main())
