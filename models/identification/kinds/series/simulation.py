"""A model run over a record: compiled once, eight parameter sets side by side, free or with an observer."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from models.assembly.model import Assembly, assemble, followed_by
from models.checks.usable import gone
from models.compiled.kernel import LANES, NEVER_S, SLOW_S, Kernel
from models.drives.drive import Drive
from models.effects import Catalogue
from models.effects.effect import Effect
from models.identification.kind import Array
from models.identification.kinds.series.drive_input import (
    CLOCK_OFFSET,
    SWITCH_DELAY,
    evenly,
    feed,
    interval,
)
from models.identification.settings import SET
from models.records.record import USED, Record
from models.surfaces.surface import Surface
from models.theta import Theta


@cache
def _model(surface: Surface, drive: Drive, effects: tuple[type[Effect], ...]) -> tuple[Assembly, Kernel]:
    assembly = assemble(surface, drive, effects)
    return assembly, Kernel(assembly.step, assembly.correct, SLOW_S if drive.anchored else NEVER_S)


def _late(effects: Sequence[type[Effect]], theta: Theta) -> float:
    """Delay of the measurement in s by the clock and the `effects`."""
    delays = (float(e().delay(theta.effects[e.id])) for e in effects)
    return theta.get(CLOCK_OFFSET, 0.0) + sum(delays)


@dataclass(frozen=True)
class Runner:
    """The models of one surface and drive."""

    surface: Surface
    drive: Drive
    catalogue: Catalogue

    def runs(
        self, record: Record, thetas: Sequence[Theta], memory: float | None, measured: Array | None, fine: bool = True
    ) -> list[Array]:
        """The output at each of `thetas`; those with the same effects and switch delay run side by side."""
        alike: dict[tuple[tuple[str, ...], float], list[int]] = {}
        for i, theta in enumerate(thetas):
            alike.setdefault((tuple(sorted(theta.effects)), theta.get(SWITCH_DELAY, 0.0)), []).append(i)
        outputs: dict[int, Array] = {}
        for members in alike.values():
            for k in range(0, len(members), LANES):
                some = members[k : k + LANES]
                shown = self._side_by_side(record, [thetas[i] for i in some], memory, measured, fine)
                outputs.update(zip(some, shown, strict=True))
        return [outputs[i] for i in range(len(thetas))]

    def _side_by_side(
        self, record: Record, thetas: Sequence[Theta], memory: float | None, measured: Array | None, fine: bool
    ) -> list[Array]:
        active = tuple(self.catalogue[name] for name in sorted(thetas[0].effects))
        assembly, kernel = _model(self.surface, self.drive, active)
        rigid = self.drive.imposed and not any(effect.answers("link") for effect in active)
        even = evenly(record, (self.drive.commanded, self.drive.measured, USED))
        measured = None if measured is None else even[self.drive.measured]
        fed = feed(self.drive, even, rigid, thetas[0].get(SWITCH_DELAY, 0.0), fine)
        shown = np.empty((len(fed.commands), LANES))
        filled = [*thetas, *[thetas[-1]] * (LANES - len(thetas))]
        parameters = np.array([assembly.vector(theta) for theta in filled]).T.copy()
        states = np.repeat(self._start(assembly, even, measured)[:, None], LANES, axis=1)
        seen = shown
        if measured is not None and memory:
            spread = fed.spread(np.where(gone(even), np.nan, measured))
            at, late = np.arange(len(spread)), [_late(assembly.effects, theta) / fed.dt for theta in filled]
            seen = np.stack([np.interp(at + n, at, spread) for n in late] if any(late) else [spread] * LANES, axis=1)
        if not self.drive.anchored and measured is not None and memory:
            n = 1 + max(1, round(SET.start_s / fed.dt))
            kernel.many(states.copy(), fed.commands[:n], seen, 0.0, parameters, fed.substeps, fed.dt, shown)
            there = np.isfinite(seen[:n]).all(axis=1)
            if there.any():  # the noise of one sample's position would last
                states[0] += np.mean((seen[:n] - shown[:n])[there], axis=0)
        gain = fed.dt / memory if memory else 0.0
        kernel.many(states, fed.commands, seen, gain, parameters, fed.substeps, fed.dt, shown)
        rows = shown.T.copy()
        late = [_late(assembly.effects, theta) for theta in thetas]
        return [
            np.interp(record["t_s"] - delay, even["t_s"], fed.samples(row))
            if delay or even is not record
            else fed.samples(row)
            for row, delay in zip(rows, late, strict=False)
        ]

    def _start(self, assembly: Assembly, record: Record, measured: Array | None) -> Array:
        state = assembly.start()
        first = record[self.drive.commanded][0]
        if self.drive.anchored:
            seen = None if measured is None else measured[: max(1, round(0.02 / interval(record)))]
            state[0] = first if self.drive.imposed or seen is None else float(np.mean(seen))
        elif measured is not None:
            state[0] = measured[0]
        for k, name in enumerate(assembly.states):
            if followed_by(assembly.effects, name) == "command":
                state[k] = first
        return state
