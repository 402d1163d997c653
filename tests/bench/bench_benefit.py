"""What a lab's first two records gain in control: rigs drawn at random, each led by every model and by what is chosen.

`python -m tests.bench.bench_benefit --out DIR [--count 40] [--from 0] [--workers 1]` makes the rigs of
`tests.bench.benefit_rigs`, runs `capsule close-loop` on two records of each and `capsule track` on two references that
no record is like. Each run is a JSON line of DIR/rig_N/runs.jsonl; what is on file is not run again, and a larger count
adds rigs. Then the table: errors in mm, root mean square over both references; of nominal, calibrated, augmented and
right model that of the better controller, so chosen is measured against what nobody knows beforehand.

- chosen: `capsule track SCENARIO.toml --model MODEL.toml` without `--stage` and `--controller`.
- right: the truth's own base, held, and the catalogue's effect fitted with it to a rich record (30 s, 50 um, 200 Hz)
  of the rig as it is driven, with a finer shape where it leaves more than noise; with nothing hidden the base alone.
- pid: knows no model; an inner mass has none.

`--table` prints what DIR holds and runs nothing.
"""

import argparse
import contextlib
import io
import json
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Any, Final

from controller.drives import DRIVES
from hil.app.main import run as capsule
from hil.app.system import INTERRUPTED
from models.effects import REFINEMENTS
from models.files.toml import toml_text
from models.identification.finding import STAGES
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.model import Model
from models.records.record import read_record
from models.rigs.reader import read_rig
from plant.experiments.scenario import write_record
from tests.bench.benefit_rigs import RECORDS, RIG, DrawnRig, drawn
from tests.plant.series import answer_of

Row = dict[str, Any]
CLOSED: Final = "close-loop"
CHOSEN, PID, RIGHT, USUAL = "chosen", "pid", "right", "usual"
COLUMNS: Final = (*STAGES, CHOSEN, PID, RIGHT)
LEADING: Final = {"magnetic": ("mpc", "feedforward"), "coil": ("mpc", "feedforward"), "vibro": ("vibro",)}
RICH: Final = "rich.csv"
WORSE: Final = 1.05
FLOOR_MM: Final = 1e-6
"""Below it no ratio is formed."""


def answered(words: Sequence[str]) -> tuple[int, Row]:
    """Status and JSON object of a `capsule` command; what it said instead where it printed none. One that is ended from
    outside ends this.
    """
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as said:
        status = capsule([*words, "--json"])
    if status == INTERRUPTED:
        raise KeyboardInterrupt
    text = out.getvalue().strip()
    return status, dict(json.loads(text)) if text.startswith("{") else {"said": said.getvalue()[-500:]}


def folder_of(out: Path, number: int) -> Path:
    return out / f"rig_{number}"


def rows_of(out: Path, number: int) -> list[Row]:
    """What is on file of a rig."""
    ledger = folder_of(out, number) / "runs.jsonl"
    return [json.loads(line) for line in ledger.read_text().splitlines()] if ledger.exists() else []


def measure(number: int, out: Path) -> int:
    """Run what is missing of a rig."""
    rig, folder, rows = drawn(number), folder_of(out, number), rows_of(out, number)
    folder.mkdir(parents=True, exist_ok=True)
    done = {(row["what"], row["controller"], row["reference"]) for row in rows}
    for row in runs(rig, folder, done):
        with (folder / "runs.jsonl").open("a") as file:
            file.write(json.dumps({"rig": number, **row}) + "\n")
        print(f"rig {number}: {row['what']} {row['controller']} {row['reference']} {told(row)}", flush=True)
    return number


def told(row: Row) -> str:
    """A row's result in words."""
    if "said" in row:
        return str(row["said"])
    return str(row["verdict"]) if row["what"] == CLOSED else f"{1e3 * row['rmse_m']:.3f} mm"


def runs(rig: DrawnRig, folder: Path, done: set[tuple[str, str, int]]) -> Iterator[Row]:
    """One row a run that is not `done`."""
    model, right = folder / "out" / "model.toml", folder / "right.toml"
    if (CLOSED, "", 0) not in done:
        yield {"what": CLOSED, "controller": "", "reference": 0, **closed(rig, folder)}
    if not model.exists():
        return
    if not right.exists():
        right.write_text(right_model(rig, folder).to_toml(), encoding="utf-8")
    stages = [(stage, model) for stage in STAGES]
    led = [(what, file, name) for what, file in [*stages, (RIGHT, right)] for name in LEADING[rig.kind]]
    led += [(PID, model, "pid")] if rig.kind != "vibro" else []
    for reference in range(len(rig.references)):
        scenario = folder / f"reference_{reference}.toml"
        scenario.write_text(toml_text(rig.scenario(reference)), encoding="utf-8")
        for what, file, name in [*led, (CHOSEN, model, "")]:
            if (what, name, reference) not in done:
                stage = {RIGHT: "augmented", PID: "nominal"}.get(what, what)
                asked = ["--stage", stage, "--controller", name] if name else []
                row = tracked(["track", str(scenario), "--model", str(file), *asked])
                yield {"what": what, "controller": name, "reference": reference, **row}


def closed(rig: DrawnRig, folder: Path) -> Row:
    """What `close-loop` says of the two records."""
    rig.write_records(folder)
    records = [str(folder / name) for name in RECORDS]
    _, report = answered(["close-loop", *records, "--rig", str(folder / RIG), "--out", str(folder / "out")])
    if "said" in report:
        return report
    effects = [[one["id"], *one["equivalent"]] for one in report["effects"]]
    return {key: report.get(key) for key in ("verdict", "reasons", "seconds", "error")} | {"effects": effects}


def tracked(words: Sequence[str]) -> Row:
    """What a run of `track` says."""
    began = time.process_time()
    _, found = answered(words)
    if "said" in found:
        return found
    kept = ("chosen", "model", "hard_violations", "ended", "led_share")
    return {
        "rmse_m": found["tracking_rmse_m"], "max_m": found["tracking_max_m"], "led": found["controller"],
        "limit_use": {name: round(share, 3) for name, share in found["limit_use"].items() if share > 1 + 1e-6},
        "monitor": found["monitor"]["state"], "switches": len(found["events"]),
        **{key: found.get(key) for key in kept}, "cpu_s": round(time.process_time() - began, 1),
    }  # fmt: skip


def right_model(rig: DrawnRig, folder: Path) -> Model:
    """The model that is right of the rig as it is driven: see above."""
    belief = read_rig(folder / RIG)
    write_record(folder / RICH, rig.rich(0))
    records = [read_record(folder / RICH, belief)]
    kind, base = kind_for(belief, records), rig.base()
    start = kind.nominal() | base
    stages = {"nominal": kind.nominal(), "calibrated": start, "augmented": start}
    for effect, numbers in rig.driven.items():
        name = answer_of(effect)
        held = replace(kind, base=tuple(replace(p, value=start[p.key], fit=False) for p in kind.base))
        fitter = Fitter.of(held, records, (name,))
        alike = {(a.parameter.effect, a.parameter.name): a.parameter for a in fitter.axes}
        known = {key: numbers[key[1]] for key, p in alike.items() if key[1] in numbers and p.holds(numbers[key[1]])}
        plain = fitter.exactly(fitter.far([start | known]).theta)
        shapes = [one for one in REFINEMENTS if one.id in held.declared(name).refined_by and rig.kind in one.kinds]
        finer = [Fitter.of(held, records, (name, one.id)) for one in ([] if plain.by_chance else shapes)]
        fits = [plain, *(one.exactly(plain.theta) for one in finer)]
        stages["augmented"] = min(fits, key=lambda fit: fit.cost).theta
    return Model(belief.kind, stages, "named")


def error_mm(rows: Iterable[Row], what: str, controller: str = "") -> float:
    """Root mean square over the references of the better controller, or of the one named; NaN where a run is missing,
    inf where one was refused.
    """
    errors: dict[str, dict[int, float]] = {}
    for row in rows:
        if row["what"] == what and controller in ("", row["controller"]):
            errors.setdefault(row["controller"], {})[row["reference"]] = 1e3 * row.get("rmse_m", math.inf)
    return min((math.hypot(*own.values()) / math.sqrt(2) for own in errors.values() if len(own) == 2), default=math.nan)


def usual(rig: DrawnRig) -> str:
    """The controller that leads where none is asked for."""
    return DRIVES[rig.kind].leading


def violations(rows: Iterable[Row], *whats: str) -> int:
    """Ticks of the runs of `whats` in which a hard limit was broken."""
    return sum(row.get("hard_violations", 0) for row in rows if row["what"] in whats)


def said_of_choice(rows: Sequence[Row]) -> str:
    """What was chosen, with why where that is said."""
    chosen = [row for row in rows if row["what"] == CHOSEN and "rmse_m" in row]
    told = [row.get("chosen") or {"stage": row["model"], "controller": row["led"]} for row in chosen]
    return "; ".join(dict.fromkeys(f"{one['stage']} {one['controller']} {one.get('why', '')}".strip() for one in told))


def line(rig: DrawnRig, rows: Sequence[Row]) -> str:
    """A rig's row of the table."""
    hidden = ", ".join(rig.recorded) + (f" (other gut: {rig.other})" if rig.other else "") or "-"
    said = next((row for row in rows if row["what"] == CLOSED), {})
    names = "; ".join("/".join(one) for one in said.get("effects", ()))
    errors = " | ".join(f"{error_mm(rows, what):.3f}".replace("nan", "-") for what in COLUMNS)
    broken = f"{violations(rows, CHOSEN)} of {violations(rows, *COLUMNS)}"
    verdict = f"{said.get('verdict', 'refused')} {names}".strip()
    return f"| {rig.number} {rig.kind} | {hidden} | {verdict} | {errors} | {broken} | {said_of_choice(rows)} |"


def figures(measured: Sequence[tuple[DrawnRig, Sequence[Row]]]) -> list[str]:
    """The figures to reach."""
    errors = [
        (rig, {what: error_mm(rows, what) for what in COLUMNS} | {USUAL: error_mm(rows, "nominal", usual(rig))}, rows)
        for rig, rows in measured
    ]
    judged = [(rig, e, rows) for rig, e, rows in errors if math.isfinite(e["nominal"]) and not math.isnan(e[CHOSEN])]
    own = [(rig, e) for rig, e, _ in judged if not rig.other]
    others = [e for rig, e, _ in judged if rig.other]

    def worse(e: dict[str, float], nominal: str = "nominal") -> bool:
        return e[CHOSEN] > WORSE * min(e[nominal], math.inf if math.isnan(e[PID]) else e[PID])

    def gain(e: dict[str, float], what: str) -> float:
        return e["nominal"] / max(e[what], FLOOR_MM)

    hidden = [e for rig, e in own if rig.recorded]
    halved = [e for e in hidden if gain(e, RIGHT) >= 2]
    clean = [rows for rig, rows in measured if not rig.recorded]
    wrong = sum(any(row["what"] == CLOSED and row.get("verdict") != "none" for row in rows) for rows in clean)
    gains, bound = (f"{median(gain(e, what) for e in hidden):.2f}" if hidden else "-" for what in (CHOSEN, RIGHT))
    broken = [[violations(rows, *whats) for _, _, rows in judged] for whats in ((CHOSEN,), COLUMNS)]
    ticks = "; ".join(f"{sum(n > 0 for n in own)} rigs, {sum(own)} ticks" for own in broken)
    return [
        f"chosen worse than nominal or PID by more than 5 %: {sum(worse(e) for _, e in own)} of {len(own)}; in another"
        f" gut {sum(map(worse, others))} of {len(others)}; than nominal with the usual controller or PID:"
        f" {sum(worse(e, USUAL) for _, e in own)}, in another gut {sum(worse(e, USUAL) for e in others)}",
        f"nominal / chosen, median over {len(hidden)} rigs with a hidden effect: {gains}; right: {bound}",
        f"at least halved of those that the right model halves: {sum(gain(e, CHOSEN) >= 2 for e in halved)} of"
        f" {len(halved)}",
        f"hard limits broken by chosen; by all columns: {ticks}",
        f"nothing hidden, named or unknown: {wrong} of {len(clean)}",
    ]


def report(out: Path, numbers: Iterable[int]) -> None:
    """Print the table of what is on file, and the figures."""
    measured = [(drawn(number), rows) for number in numbers if (rows := rows_of(out, number))]
    heads = ("rig", "hidden", "verdict", *COLUMNS, "hard violations", "chosen")
    print(f"| {' | '.join(heads)} |\n|{' --- |' * len(heads)}")
    for rig, rows in measured:
        print(line(rig, rows))
    print("", *figures(measured), sep="\n")


def main() -> None:
    """Run what is missing, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--from", type=int, default=0, dest="first", metavar="N")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--table", action="store_true", help="run nothing")
    asked = parser.parse_args()
    numbers = range(asked.first, asked.first + asked.count)
    if not asked.table:
        with ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool:
            for count, number in enumerate(pool.map(measure, numbers, [asked.out] * len(numbers)), 1):
                print(f"rig {number} done, {count} of {len(numbers)}", flush=True)
    report(asked.out, numbers)


if __name__ == "__main__":
    main()
