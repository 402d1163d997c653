"""Localisers and drives that lie, in lockstep: whether each run is stopped, how far the true capsule gets from the
wanted place until then, and how long that takes; and sound runs, none of which may be stopped.

`python -m tests.bench.bench_lies [--kinds NAME ...] [--rigs magnetic coil vibro] [--references hold ramp sine] [--sizes
0 1 2] [--seconds S] [--controllers NAME ...] [--jobs N] [--lines FILE]`: a line a kind and rig. `--sound N`: instead N
sound runs, with friction, waves, folds and narrow places that nobody told the controller of, a gut, a magnet and a
localisation of their own; a line each kind of rig and what each stopped run was stopped for. Runs that the truth shows
outside the envelope, or behind a magnet that pulls by all that it has, count apart. FILE gets each run as a line of
JSON once it has ended, and runs that stand there are not done again. Status 1 where a run was unsafe, or a sound one
falsely stopped.
"""

import argparse
import json
import math
import multiprocessing
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from controller.drives import DRIVES
from hil.app.scenario.bus_scenario import SilScenario
from hil.app.sil.fault_outcomes import outcomes
from hil.app.sil.loop import SilTrace, run_sil
from hil.app.sil.testbed import believed_on_bus
from models.theta import Theta
from plant import layout as at
from plant.drives import Carriage, TrueCoil
from tests.bench.lie_cases import EVERY_RIG, LIES, REFERENCES, sound
from tests.hil.app.sil.sil_runs import scenario_of

SOUND_S: Final = 12.0
STOOD_S, STOOD_M = 0.06, 5e-4
USUAL: Final = {"magnetic": "feedforward", "coil": "feedforward", "vibro": "vibro"}


@dataclass(frozen=True)
class Job:
    """One run: the lie of kind `name` in its size number `size`, or, where no kind is named, the sound run `size`."""

    name: str
    rig: str
    reference: str
    size: int
    seconds: float = 0.0
    controller: str = ""


@dataclass(frozen=True)
class Result:
    """What came of a job: why it was stopped ("": it was not), the time from the lie to the safe state in s (nan:
    none), the largest distance of the true capsule from the wanted place in m, why it was unsafe, and the processor's
    time for it in s.
    """

    job: Job
    stopped: str
    after_s: float
    distance_m: float
    unsafe: str
    cpu_s: float


def main() -> int:
    """Run them; 1 where one was unsafe, or a sound one stopped."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", nargs="*", default=list(LIES), choices=list(LIES), metavar="KIND")
    parser.add_argument("--rigs", nargs="*", default=list(EVERY_RIG), choices=EVERY_RIG)
    parser.add_argument("--references", nargs="*", default=list(REFERENCES), choices=list(REFERENCES))
    parser.add_argument("--sizes", nargs="*", type=int, default=[0, 1, 2], choices=range(3))
    parser.add_argument("--seconds", type=float, default=0.0, help="length of each run; else as its kind needs")
    parser.add_argument("--controllers", nargs="*", default=[""], help="the rig's usual one where left out")
    parser.add_argument("--sound", nargs="?", type=int, const=300, help="so many sound runs instead (300)")
    parser.add_argument("--first", type=int, default=0, help="number of the first sound run")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--lines", type=Path, help="file of runs, to be gone on with")
    asked = parser.parse_args()
    began = time.perf_counter()
    jobs = list(sound_jobs(asked) if asked.sound else lie_jobs(asked))
    before = {} if asked.lines is None or not asked.lines.exists() else read(asked.lines)
    found = [before[job] for job in jobs if job in before]
    for result in run_all([job for job in jobs if job not in before], asked.jobs):
        found.append(result)
        if asked.lines is not None:
            with asked.lines.open("a", encoding="utf-8") as file:
                file.write(json.dumps(plain(result)) + "\n")
    bad = say_sound(found) if asked.sound else say_lies(found)
    cpu_s = sum(result.cpu_s for result in found)
    print(f"{time.perf_counter() - began:.0f} s by the wall clock, {cpu_s:.0f} s of processor, {asked.jobs} processes")
    return int(bad > 0)


def lie_jobs(asked: argparse.Namespace) -> Iterator[Job]:
    """Every kind, size and reference on every rig that can have it."""
    for name in asked.kinds:
        for rig in (one for one in LIES[name].rigs if one in asked.rigs):
            for controller in asked.controllers:
                for reference in asked.references:
                    for size in asked.sizes:
                        seconds = asked.seconds or LIES[name].seconds
                        yield Job(name, rig, reference, size, seconds, controller or USUAL[rig])


def sound_jobs(asked: argparse.Namespace) -> Iterator[Job]:
    """Sound runs, the kinds of rig and the references in turn."""
    rigs, references = asked.rigs, asked.references
    for k in range(asked.first, asked.first + asked.sound):
        rig = rigs[k % len(rigs)]
        controller = asked.controllers[k % len(asked.controllers)] or USUAL[rig]
        yield Job("", rig, references[k // len(rigs) % len(references)], k, asked.seconds or SOUND_S, controller)


def run_all(jobs: Sequence[Job], processes: int) -> Iterator[Result]:
    """Their results as they come, with progress on standard error."""
    context = multiprocessing.get_context("spawn")
    began, bad = time.perf_counter(), 0
    with ProcessPoolExecutor(processes, mp_context=context) as pool:
        waiting = [pool.submit(run, job) for job in jobs]
        for k, done in enumerate(as_completed(waiting), start=1):
            result = done.result()
            left_s = (time.perf_counter() - began) / k * (len(jobs) - k)
            bad += bool(result.unsafe if result.job.name else result.stopped)
            told = f"\r{k} of {len(jobs)}, {bad} bad, {left_s / 60:.0f} min left  "
            print(told, end="", file=sys.stderr, flush=True)
            yield result
    print(file=sys.stderr)


def run(job: Job) -> Result:
    """One run."""
    began = time.process_time()
    faults: Sequence[Any] = ()
    tables: dict[str, Any] = {"reference": REFERENCES[job.reference][job.rig]}
    if job.name:
        faults = LIES[job.name].sizes[job.size]
    else:
        tables |= sound(job.size, job.rig)
    scenario = scenario_of(job.rig, job.seconds, *faults, **tables)
    trace = run_sil(scenario, believed_on_bus(scenario, Theta()), job.controller, job.size)
    cpu_s = time.process_time() - began
    if not job.name:
        left = bool(trace.stopped_because) and was_left(scenario, trace)
        return Result(job, trace.stopped_because, math.nan, math.nan, "left behind" if left else "", cpu_s)
    outcome = outcomes(scenario, trace)[-1]
    return Result(job, trace.stopped_because, outcome.safe_after_s, outcome.distance_m, outcome.why, cpu_s)


def was_left(scenario: SilScenario, trace: SilTrace) -> bool:
    """Whether a sound run was rightly stopped: the true capsule was outside the envelope, or stayed behind a magnet
    that truly pulled by nine tenths of its gap for as long as an answer may take, or stood truly still while a coil
    pushed.
    """
    moves = trace.slots[trace.slots[:, 1] == 0, 0]
    rows = trace.rows[trace.rows[:, at.O_T] <= (moves[-1] if moves.size else 0.0)]
    limits, drive = scenario.loop.limits, scenario.loop.truth.drive
    ticks = scenario.loop.control.tick_s * np.arange(len(trace.steered))
    off = np.abs(rows[:, at.O_X] - np.interp(rows[:, at.O_T], ticks, trace.steered[:, 0]))
    if not isinstance(drive, Carriage):
        late = rows[rows[:, at.O_T] > rows[-1, at.O_T] - STOOD_S, at.O_X]
        stood = isinstance(drive, TrueCoil) and np.ptp(late) < STOOD_M
        return bool(stood or np.max(off[-200:]) >= 0.9 * (limits.envelope_m or DRIVES[scenario.loop.kind].around_m))
    gap = np.abs(rows[:, at.O_DRIVE] - rows[:, at.O_X])[rows[:, at.O_T] > rows[-1, at.O_T] - 0.9]
    return bool(np.min(gap) >= 0.85 * limits.gap_share * drive.gap_limit_m)


def say_lies(found: Iterable[Result]) -> int:
    """A row a kind and rig of a table in Markdown, the unsafe runs one by one; the number of unsafe ones."""
    groups: dict[tuple[str, str], list[Result]] = defaultdict(list)
    for result in found:
        groups[result.job.name, result.job.rig].append(result)
    print("| lie | rig | runs | stopped | farthest mm | latest s | unsafe |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for (name, rig), some in sorted(groups.items(), key=lambda g: (list(LIES).index(g[0][0]), g[0][1])):
        print(f"| {name} | {rig} | {numbers(some)} |")
    every = [one for some in groups.values() for one in some]
    print(f"| all | all | {numbers(every)} |")
    for result in (one for one in every if one.unsafe):
        job = result.job
        print(
            f"unsafe ({result.unsafe}): {job.name}, size {job.size}, {job.rig}, {job.reference}, {job.controller}:"
            f" {1e3 * result.distance_m:.1f} mm; {result.stopped or 'not stopped'}"
        )
    return sum(bool(one.unsafe) for one in every)


def numbers(some: Sequence[Result]) -> str:
    """Runs, those that were stopped, largest distance in mm, longest time to the safe state in s, unsafe ones."""
    farthest = max((one.distance_m for one in some), default=0.0)
    latest = max((one.after_s for one in some if not math.isnan(one.after_s)), default=math.nan)
    stopped, unsafe = sum(bool(one.stopped) for one in some), sum(bool(one.unsafe) for one in some)
    when = "-" if math.isnan(latest) else f"{latest:.2f}"
    return f"{len(some)} | {stopped} | {1e3 * farthest:.1f} | {when} | {unsafe}"


def say_sound(found: Iterable[Result]) -> int:
    """A line a kind of rig, what was stopped and why, and all in all; the number of false alarms."""
    every = list(found)
    for rig in sorted({one.job.rig for one in every}):
        some = [one for one in every if one.job.rig == rig]
        left, stopped = sum(bool(one.unsafe) for one in some), sum(bool(one.stopped) for one in some)
        print(f"{rig:9s} {len(some):5d} runs, {stopped} stopped, {left} of them left behind")
    for one in (one for one in every if one.stopped):
        job = one.job
        print(f"{one.unsafe or 'FALSE'}: run {job.size}, {job.rig}, {job.reference}, {job.controller}: {one.stopped}")
    false = [one for one in every if one.stopped and not one.unsafe]
    print(f"{len(every)} sound runs, {len(false)} falsely stopped")
    return len(false)


def plain(result: Result) -> dict[str, Any]:
    """A result for JSON: no number is null."""
    return {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in asdict(result).items()}


def read(path: Path) -> dict[Job, Result]:
    """The runs of a file that `--lines` wrote."""
    found = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        fields = {k: math.nan if v is None else v for k, v in json.loads(line).items()}
        job = Job(**fields.pop("job"))
        found[job] = Result(job, **fields)
    return found


if __name__ == "__main__":
    sys.exit(main())
