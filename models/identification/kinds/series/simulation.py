"""A model run over a record: compiled once, eight parameter sets side by side, free or with an observer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from types import MappingProxyType

import numpy as np

from models.assembly.model import Assembly, assemble, followed_by
from models.checks.usable import gone
from models.compiled.kernel import LANES, NEVER_S, SLOW_S, Kernel
from models.compiled.residuals import in_time, lagging, sampled
from models.drives.drive import Drive
from models.effects import Catalogue
from models.effects.effect import Effect
from models.identification.kind import Array
from models.identification.kinds.series.drive_input import (
    CLOCK_OFFSET,
    KEPT,
    SWITCH_DELAY,
    Feed,
    evenly,
    feed,
    internal_step,
    interval,
)
from models.identification.settings import SET
from models.records.record import USED, Record
from models.rigs.columns import FURTHER
from models.surfaces.surface import Surface
from models.theta import Theta


@cache
def _model(
    surface: Surface, drive: Drive, effects: tuple[type[Effect], ...], beside: tuple[str, ...] = ()
) -> tuple[Assembly, Kernel]:
    assembly = assemble(surface, drive, effects, further=beside)
    return assembly, Kernel(assembly.step, assembly.correct, SLOW_S if drive.anchored else NEVER_S)


def _late(effects: Sequence[type[Effect]], theta: Theta) -> float:
    """Delay of the measurement in s by the clock and the `effects`."""
    delays = (float(e().delay(theta.effects[e.id])) for e in effects)
    return theta.get(CLOCK_OFFSET, 0.0) + sum(delays)


LAUNCH = ("_start_x", "_start_v")
"""Columns of a record without its measured column: where a launched body began, and how fast."""


@lru_cache(maxsize=KEPT)
def launch(record: Record, column: str) -> tuple[float, float]:
    """Place and speed at the start of a record by its first samples; 0 where nothing was measured. An acceleration or a
    speed within three standard errors is none.
    """
    if LAUNCH[0] in record.columns:
        return float(record[LAUNCH[0]][0]), float(record[LAUNCH[1]][0])
    if column not in record.columns:
        return 0.0, 0.0
    n = min(max(8, round(SET.axis_start_s / interval(record))), len(record))
    t, x = record["t_s"][:n] - record["t_s"][0], record[column][:n]
    powers = np.vander(t / t[-1], 3, increasing=True)
    kept = [0, 1, 2]
    for k in (2, 1):
        some = powers[:, kept]
        fitted, *_ = np.linalg.lstsq(some, x, rcond=None)
        left = float(np.sum((x - some @ fitted) ** 2)) / max(n - len(kept), 1)
        if abs(fitted[k]) <= 3 * np.sqrt(left * np.linalg.inv(some.T @ some)[k, k]):
            kept.remove(k)
    fitted, *_ = np.linalg.lstsq(powers[:, kept], x, rcond=None)
    return float(fitted[0]), float(fitted[1] / t[-1]) if 1 in kept else 0.0


@lru_cache(maxsize=KEPT)
def _observed(even: Record, column: str) -> Array:
    """What an observer sees: NaN where the sensor gives nothing."""
    return np.where(gone(even), np.nan, even[column])


@dataclass(frozen=True)
class Runner:
    """The models of one surface and drive."""

    surface: Surface
    drive: Drive
    catalogue: Catalogue

    def runs(
        self,
        record: Record,
        thetas: Sequence[Theta],
        memory: float | None,
        placed: bool = True,
        fine: bool = True,
        beside: Mapping[str, Array] = MappingProxyType({}),
    ) -> Array:
        """The output (len(thetas), samples) at each of `thetas`; those with the same effects and switch delay run side
        by side. Where `placed`, the body starts where it was measured. `beside` of the same shape gets the further
        columns that it names.
        """
        alike: dict[tuple[tuple[str, ...], float], list[int]] = {}
        for i, theta in enumerate(thetas):
            alike.setdefault((tuple(sorted(theta.effects)), theta.get(SWITCH_DELAY, 0.0)), []).append(i)
        outputs = np.empty((len(thetas), len(record)))
        for (names, delay), members in alike.items():
            active = tuple(self.catalogue[name] for name in names)
            rigid = self.drive.imposed and not any(effect.answers("link") for effect in active)
            even = evenly(record, (self.drive.commanded, self.drive.measured, USED))
            fed = feed(self.drive, even, rigid, delay, fine)
            for k in range(0, len(members), LANES):
                some = members[k : k + LANES]
                at = [thetas[i] for i in some]
                shown, late = self._side_by_side(even, fed, active, at, memory, placed, (*beside,))
                clock, same, rows = even["t_s"], even is record, np.array(some)
                sampled(fed.samples(shown[:, :LANES]), clock, record["t_s"], late, same, rows, outputs)
                for number, (name, output) in enumerate(beside.items(), 1):
                    column, own = FURTHER[name], shown[:, number * LANES : (number + 1) * LANES]
                    for lane, theta in enumerate(at):
                        own[:, lane] = lagging(own[:, lane], theta.get(column.key("lowpass_s"), 0.0) / fed.dt)
                    y = fed.samples(own)
                    y = np.diff(y, axis=0, prepend=y[:1]) / (fed.every * fed.dt) if column.rate else y
                    late = np.array([theta.get(column.key("clock_s"), 0.0) for theta in at])
                    sampled(y, clock, record["t_s"], late, same, rows, output)
        return outputs

    def _side_by_side(
        self,
        even: Record,
        fed: Feed,
        active: tuple[type[Effect], ...],
        thetas: Sequence[Theta],
        memory: float | None,
        placed: bool,
        beside: tuple[str, ...],
    ) -> tuple[Array, Array]:
        """The loop's outputs, a column each of `thetas` and the last repeated, `beside` them those of the further
        columns, and each one's delay in s.
        """
        assembly, kernel = _model(self.surface, self.drive, active, beside)
        lanes = [*thetas, *[thetas[-1]] * (LANES - len(thetas))]
        parameters = np.array([assembly.vector(theta) for theta in lanes]).T.copy()
        late = np.array([_late(active, theta) for theta in lanes])
        states = np.repeat(self._start(assembly, even, placed)[:, None], LANES, axis=1)
        shown = np.empty((len(fed.commands), (1 + len(beside)) * LANES))
        rest = parameters, fed.substeps, fed.dt, shown, even.began_s
        seen, gain = shown, 0.0
        if memory:
            samples, gain = _observed(even, self.drive.measured), fed.dt / memory
            seen = in_time(samples, late / (fed.every * fed.dt), len(shown), fed.first, fed.every)
        if not (self.drive.anchored or self.drive.launched) and memory:
            n = 1 + max(1, round(SET.start_s / fed.dt))
            kernel.many(states.copy(), fed.commands[:n], seen, 0.0, *rest)
            there = np.isfinite(seen[:n]).all(axis=1)
            if there.any():  # the noise of one sample's position would last
                states[0] += np.mean((seen[:n] - shown[:n, :LANES])[there], axis=0)
        kernel.many(states, fed.commands, seen, gain, *rest)
        return shown, late

    def _start(self, assembly: Assembly, record: Record, placed: bool) -> Array:
        state = assembly.start()
        first = record[self.drive.commanded][0]
        if self.drive.launched:
            x, v = launch(record, self.drive.measured)
            step = min(internal_step(self.drive, rigid=False), interval(record))
            state[:2] = x - v * step, v  # a loop's first step ends at the first sample
        elif self.drive.imposed or (self.drive.anchored and not placed):
            state[0] = first
        elif placed:
            rows = max(1, round(0.02 / interval(record))) if self.drive.anchored else 1
            state[0] = float(np.mean(record[self.drive.measured][:rows]))
        for k, name in enumerate(assembly.states):
            if followed_by(assembly.effects, name) == "command":
                state[k] = first
        return state
