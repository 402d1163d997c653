"""Confounded classes and the record that close-loop proposes for each: is the class resolved with it, and with a
generic record of the same and of twice the length?

`python -m tests.bench.bench_next_experiment [--names a b] [--draws 2] [--generic]` simulates twelve series a draw whose
records are too poor to tell the hidden effect (one pass at one speed, or at two, or there and back), closes the loop on
each, lets the plant run what is proposed, closes again, and prints a line a series. Resolved: the hidden effect is
named and nothing in its class is left.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.effects import CATALOGUE
from models.identification.experiment import propose
from models.identification.finding import Proposal
from models.identification.identify import narrowed
from models.identification.kinds import kind_for, ready
from models.identification.search.search import search
from models.records.record import Record
from models.rigs.reader import parse_rig
from plant import layout as at
from plant.experiments.examples import BELIEVED, FORCE_SPAN_N, FORCE_STD_N, POSITION_SPAN_M, POSITION_STD_M
from plant.experiments.profile import RandomRuns, Wander, piecewise_runs
from plant.rig import STEP_S, Plant, Truth
from plant.sensing import Sensor
from plant.tables import Floats
from tests.plant.series import answer_of, draw

LENGTH_S = 24.0
ONE_PASS = ((0.0, 0.5), (1.2e-3, LENGTH_S - 1.0), (0.0, 0.5))
TWO_SPEEDS = ((0.0, 0.5), (0.8e-3, 12.0), (2.0e-3, LENGTH_S - 13.0), (0.0, 0.5))
THERE_AND_BACK = ((0.0, 0.5), (2.0e-3, 11.5), (-2.0e-3, 11.5), (0.0, 0.5))


@dataclass(frozen=True)
class Series:
    """A rig of `kind` with a hidden `effect`, and the runs (speed in m/s, seconds) of its poor records."""

    kind: str
    effect: str
    runs: tuple[tuple[float, float], ...]
    seed: int

    @property
    def name(self) -> str:
        """Kind, effect and seed."""
        return f"{self.kind}_{self.effect}_{self.seed}"

    def truth(self) -> Truth:
        """The rig as it is."""
        rng, own = (np.random.default_rng(child) for child in np.random.SeedSequence(self.seed).spawn(2))
        return replace(BELIEVED[self.kind].truth(rng), hidden={self.effect: draw(self.effect, own)})  # type: ignore[arg-type]

    def record(self, drive: Floats, name: str, seed: int) -> Record:
        """What the instruments see while the rig is driven by `drive`, one value a step of the plant."""
        pulled, rig = self.kind == "pull", self.truth()
        noise, span = (FORCE_STD_N, FORCE_SPAN_N) if pulled else (POSITION_STD_M, POSITION_SPAN_M)
        plant = Plant(rig)
        rows = plant.advance(drive, 10)
        read, rng = rows[:, at.O_FORCE if pulled else at.O_X], np.random.default_rng([self.seed, seed])
        t, reading = Sensor(noise_std=noise, span=span).measure(rows[:, at.O_T], read, rng, plant.effects)
        driven, measured = ("position_m", "force_N") if pulled else ("carriage_position_m", "position_m")
        columns = {driven: np.interp(t, np.arange(drive.size) * STEP_S, drive), measured: reading}
        return Record(name, self.kind, {"t_s": t, **columns})

    def poor(self) -> list[Record]:
        """Two records of the same poor runs."""
        drive = piecewise_runs(list(self.runs), STEP_S)
        return [self.record(drive, f"poor_{k}", k) for k in (1, 2)]

    def generic(self, seconds: float) -> Record:
        """A record of the experiment that serves every effect: runs at many speeds, or a wandering carriage."""
        rng = np.random.default_rng(self.seed)
        profile = RandomRuns() if self.kind == "pull" else Wander()
        return self.record(profile.values(seconds, STEP_S, rng), "generic", 7)


POOR = (
    ("lumen_taper", ONE_PASS),
    ("tissue_drying", ONE_PASS),
    ("preconditioning", ONE_PASS),
    ("peristaltic_wave", ONE_PASS),
    ("respiration", ONE_PASS),
    ("lumen_taper", TWO_SPEEDS),
    ("tissue_drying", TWO_SPEEDS),
    ("respiration", TWO_SPEEDS),
    ("peristaltic_wave", TWO_SPEEDS),
    ("preconditioning", TWO_SPEEDS),
    ("stribeck", TWO_SPEEDS),
    ("directional_asymmetry", THERE_AND_BACK),
)


def series_of(draw_number: int) -> tuple[Series, ...]:
    """A series for each of `POOR`; other rigs and sizes with every `draw_number`, from 0 on."""
    first = 1 + draw_number * len(POOR)
    return tuple(Series("pull", effect, runs, seed) for seed, (effect, runs) in enumerate(POOR, start=first))


def family(effect: str) -> set[str]:
    """The effect, those it is declared confounded with, and those that declare it."""
    return {effect, *CATALOGUE[effect].confounders, *(e.id for e in CATALOGUE.values() if effect in e.confounders)}


@dataclass(frozen=True)
class Answer:
    """What a search among an effect's family says of records: effects with their classes, and what is proposed."""

    effects: dict[str, tuple[str, ...]]
    proposal: Proposal | None
    seconds: float

    @classmethod
    def of(cls, series: Series, records: Sequence[Record]) -> Answer:
        """Search and proposal, as close-loop does both."""
        rig = parse_rig(BELIEVED[series.kind].tables(), "rig")
        train = [ready(record, rig) for record in records]
        kind = kind_for(rig, train)
        wanted = family(answer_of(series.effect))
        own = tuple(effect for effect in kind.effects if effect.id in wanted)
        kind, _ = narrowed(replace(kind, effects=own), rig, train)
        found = search(kind, train, lambda *_: None, np.random.default_rng(0))
        began = time.process_time()
        proposal = propose(kind, kind.searched(train), found, None, np.random.default_rng(0))
        return cls({e: found.equivalent[e] for e in found.effects}, proposal, time.process_time() - began)

    def resolves(self, effect: str) -> bool:
        """Whether `effect` is named and nothing in its class is left."""
        return self.effects.get(answer_of(effect)) == ()

    def __str__(self) -> str:
        return ", ".join("/".join((e, *alike)) for e, alike in self.effects.items()) or "-"


def line(series: Series, generic: bool) -> str:
    """What the poor records tell, and what a further record of each sort adds."""
    poor = series.poor()
    first = Answer.of(series, poor)
    if first.proposal is None:
        return f"{series.name} | {first} | nothing to tell apart"
    p = first.proposal
    apart = min(one.standard_deviations for one in p.separations)
    length = float(p.times_s[-1])
    t = np.arange(round(length / STEP_S) + 1) * STEP_S
    own = series.record(np.interp(t, p.motion["t_s"], p.motion[p.column]), "own", 9)
    further = [own, series.generic(length), series.generic(2 * length)] if generic else [own]
    cells = [series.name, str(first), f"{apart:.1f}", f"{first.seconds:.1f}"]
    for record in further:
        answer = Answer.of(series, [*poor, record])
        cells.append(f"{'yes' if answer.resolves(series.effect) else 'no'} ({answer})")
    return " | ".join(cells)


_HEADER = "series | poor records | predicted, std | processor s | own, T | generic, T | generic, 2 T"


def main() -> None:
    """A line a series."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--names", nargs="*")
    parser.add_argument("--draws", type=int, nargs="*", default=[0], help="draws of rigs, from 0 on")
    parser.add_argument("--generic", action="store_true", help="compare with generic records, of T and of 2 T")
    asked = parser.parse_args()
    print(_HEADER)
    for series in (one for number in asked.draws for one in series_of(number)):
        if asked.names is None or series.name in asked.names:
            print(line(series, asked.generic), flush=True)


if __name__ == "__main__":
    main()
