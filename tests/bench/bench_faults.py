"""Every fault in every state of every kind of drive, at several phases of the tick: the worst time to the safe state,
and what was unsafe.

`python -m tests.bench.bench_faults [magnetic coil vibro] [--drives cia402 odrive moteus] [--phases N] [--faults KIND
...] [--targets TARGET ...] [--states STATE ...] [--pairs]`; a line a fault, the worst over states that move and phases.
`--pairs`: instead each two of the ten faults that are most likely, at the same time.
`--drives`: the magnetic rig with other makers' drives instead, and the faults through which each of them goes, those of
an operator among them. Faults of an operator come to a run that somebody steers, faults of frames' authenticators to
one over an authenticated bus.
"""

import argparse
import itertools
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from hil.drives.makers import ACTUATORS
from hil.simulated.faults import KINDS, OPERATOR, Fault
from tests.hil.app.sil.sil_runs import RIGS, run
from tests.hil.simulated.fault_rows import MAKERS_ROWS, OWN_KINDS

LENGTH_S: Final = 0.2
STATES: Final[Mapping[str, tuple[float, tuple[Mapping[str, Any], ...]]]] = {
    "boot": (0.010, ()),
    "self_test": (0.035, ()),
    "ready": (0.060, ()),
    "enabled, at rest": (0.090, ()),
    "enabled, moving": (0.400, ()),
    "derated": (0.400, ({"kind": "over_temperature", "at_s": 0.2, "duration_s": 9.0, "value": 42.0},)),
    "quick stop": (0.400, ({"kind": "late_solve", "at_s": 0.3935, "duration_s": 0.02},)),
    "fault": (0.400, ({"kind": "drop", "at_s": 0.3, "duration_s": 0.05},)),
}
"""When the fault comes and what came before it, so that the drive is in that state."""

LIKELY: Final = (
    ("drop", "commands"),
    ("drop", "feedback"),
    ("lost", "localisation"),
    ("delay", "all"),
    ("corrupt", "commands"),
    ("killed", ""),
    ("late_solve", ""),
    ("bus_off", "controller"),
    ("drive_reset", ""),
    ("over_temperature", ""),
)
"""The ten faults that are most likely on a bench: cables, load of the machine, supply, heat, a crash."""


@dataclass
class Worst:
    """The worst of one fault on one kind of drive, in s; which state it was in; runs, those that rode through, unsafe
    ones, and those in which the drive moved again after it had been safe.
    """

    after_s: float = 0.0
    since_good_s: float = 0.0
    state: str = ""
    runs: int = 0
    rode: int = 0
    unsafe: int = 0
    again: list[str] = field(default_factory=list)


def main() -> int:
    """Run the matrix; 1 where anything was unsafe."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=list(RIGS))
    parser.add_argument("--phases", type=int, default=8, help="times over the whole tick at which the fault begins")
    parser.add_argument("--faults", nargs="*", default=list(KINDS), help="kinds of faults")
    parser.add_argument("--targets", nargs="*", help="targets of faults; all where left out")
    parser.add_argument("--drives", nargs="*", default=[], choices=list(ACTUATORS), help="other makers' drives")
    parser.add_argument("--pairs", action="store_true", help="each two of the most likely faults at once")
    parser.add_argument("--states", nargs="*", default=list(STATES), help="states of the drive")
    options = parser.parse_args()
    unsafe = runs = 0
    print(
        f"{'drive':9s} {'fault':24s} {'worst ms':>9s} {'since good':>11s}  {'worst in':18s} {'runs':>5s} {'rode':>5s}"
        f" {'unsafe':>7s}"
    )
    own = [(k, t) for k in options.faults if k in OWN_KINDS for t in KINDS[k].targets]
    makers = [(k, t) for k, t in MAKERS_ROWS if k in options.faults]
    makers += [(k, t) for k, t in own if Fault(k, 0.0, target=t).needs == OPERATOR]
    if options.targets is not None:
        own, makers = ([(k, t) for k, t in rows if t in options.targets] for rows in (own, makers))
    singles = [(row,) for row in (makers if options.drives else own)]
    rows: list[tuple[tuple[str, str], ...]] = [*itertools.combinations(LIKELY, 2)] if options.pairs else [*singles]
    for rig in options.drives or options.kinds:
        for row in rows:
            worst, name = Worst(), " + ".join(f"{kind} {target}".strip() for kind, target in row)
            for state, at_s, before in cases(options.phases, options.states):
                faults = [{"kind": k, "at_s": at_s, "duration_s": LENGTH_S, "target": t} for k, t in row]
                judge(worst, rig, state, faults, before)
            unsafe, runs = unsafe + worst.unsafe, runs + worst.runs
            print(
                f"{rig:9s} {name:24s} {1e3 * worst.after_s:9.1f} {1e3 * worst.since_good_s:11.1f} "
                f" {worst.state:18s} {worst.runs:5d} {worst.rode:5d} {worst.unsafe:7d}"
                f" {'moved again: ' + ', '.join(worst.again) if worst.again else ''}",
                flush=True,
            )
    print(f"{runs} runs, {unsafe} unsafe")
    return int(unsafe > 0)


def cases(phases: int, states: Sequence[str]) -> Iterator[tuple[str, float, tuple[Mapping[str, Any], ...]]]:
    """State, time of the fault, and what comes before it: one time drawn from each of `phases` equal parts of a tick,
    the same ones in every run.
    """
    rng = np.random.default_rng(7)
    for state in states:
        at_s, before = STATES[state]
        for k in range(phases):
            yield state, round(at_s + 2e-3 * (k + rng.random()) / phases, 9), before


def judge(
    worst: Worst, rig: str, state: str, faults: Sequence[Mapping[str, Any]], before: tuple[Mapping[str, Any], ...]
) -> None:
    """One run with `faults` that begin together into `worst`. A drive that did not move when they came counts for
    safety alone, unless it moves while they last.
    """
    at_s = float(faults[0]["at_s"])
    drive = {rig: {}} if rig in ACTUATORS else {}
    trace, found = run("magnetic" if drive else rig, at_s + LENGTH_S + 0.05, *before, *faults, **drive)
    outcome = next(o for o in found if o.fault.at_s == at_s)
    worst.runs += 1
    worst.unsafe += outcome.unsafe
    t, safe, good = trace.slots.T
    after = t > at_s
    if safe[np.flatnonzero(after)[0] - 1]:
        return
    if math.isnan(outcome.safe_after_s):
        worst.rode += 1
        return
    first = np.flatnonzero(after & (safe > 0))[0]
    if not safe[first:].all():
        worst.again.append(state)
    if outcome.safe_after_s > worst.after_s:
        worst.after_s, worst.state = outcome.safe_after_s, state
    if math.isfinite(good[first]):
        worst.since_good_s = max(worst.since_good_s, outcome.since_good_s)


if __name__ == "__main__":
    sys.exit(main())
