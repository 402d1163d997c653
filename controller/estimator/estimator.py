"""The estimator: beliefs kept for a while, so that a late measurement is taken in where it belongs and what came after is redone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from controller.estimator.belief import Belief, Process
from controller.estimator.noise import EXTENDED, Noise, noise_of
from controller.estimator.watch import Counts, Watch
from controller.prediction import ControlModel
from controller.signals import Estimate, Measurement

_CHANNEL_STATES = {"coil_current_A": "current_A"}
_MOST_A_TICK = 8
_FOLLOWS = 3.0


@dataclass(slots=True)
class _Tick:
    """A tick that is kept: the belief at its end with all that was measured there, and what the drive was told."""

    belief: Belief
    told: float = 0.0
    seen: list[Measurement] = field(default_factory=list)


class Estimator:
    """Position, speed, wall, drive and a disturbance force, from localisation (`position_m`) and drive feedback.

    A coil's current is a measurement of its state. What a carriage reports replaces what it was told: where they differ, the
    commands since count as off by the same.

    `observe` is called once a tick of the model. A measurement stamped up to `latest_s` ago is taken in at the tick of its stamp and
    the ticks since are computed again: their number, and so the time this takes, is bounded. Never raises.

    `unscented` averages over points a standard deviation away, of which some stick while others slip: the mean then glides along
    where the capsule jumps. Extended, the mean itself sticks and slips, and locks on to the teeth. None: by drive (`EXTENDED`).
    """

    def __init__(self, model: ControlModel, noise: Noise | None = None, *, unscented: bool | None = None) -> None:
        self.model = model
        self.noise = noise_of(model.drive.name) if noise is None else noise
        self._watch = Watch(self.noise)
        self._process = Process(model, self.noise, model.drive.name not in EXTENDED if unscented is None else unscented)
        kept = math.ceil((self.noise.latest_s + model.delay_s) / model.tick_s) + 2
        self._ticks = [_Tick(self._process.start(0.0, 1.0, 0.0, 0.0)) for _ in range(kept)]
        self._drive_state = next((n for n in model.states if n.rpartition(".")[2] == "current_A"), "")
        self.reset(0.0, 0.0)

    @property
    def counts(self) -> Counts:
        """What became of the measurements so far."""
        return self._watch.counts

    def reset(self, now: float, command: float) -> None:
        """Know nothing but the `command` in force at `now`; the first position begins a belief."""
        self._newest = 0
        self._count = 0
        self._command, self._time = command, now
        self._watch = Watch(self.noise, self.counts)
        self._offset = 0.0

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        """The estimate at `now`, a tick after the last call; `command` was in force since, `measurements` came in since."""
        if not math.isfinite(command):
            command = self._command
        if self._count:
            self._go_on(now, command)
        self._command, self._time = command, now
        for m in sorted(measurements[-_MOST_A_TICK:], key=lambda m: m.stamp_s if m.stamp_s == m.stamp_s else math.inf):
            self._take(m, now)
        return self._estimate(now)

    def _go_on(self, now: float, command: float) -> None:
        last = self._ticks[self._newest].belief
        self._newest = (self._newest + 1) % len(self._ticks)
        tick = self._ticks[self._newest]
        tick.belief.copy_from(last)
        tick.seen.clear()
        self._count = min(self._count + 1, len(self._ticks))
        self._process.predict(tick.belief, command + self._offset)
        tick.belief.time_s = now
        tick.told = command

    def _take(self, m: Measurement, now: float) -> None:
        position = m.channel == "position_m"
        if m.channel == self.model.command_name:
            self._correct_command(m, now)
            return
        if not (math.isfinite(m.value) and math.isfinite(m.stamp_s)) or not (position or self._follows(m.channel)):
            self.counts.unusable += 1
            return
        if position and not self._count:
            self._begin(m.value, now)
            return
        back = round((now - m.stamp_s + (self.model.delay_s if position else 0.0)) / self.model.tick_s)
        if not 0 <= back < self._count:
            self.counts.unusable += 1
            return
        first = (self._newest - back) % len(self._ticks)
        self._ticks[first].seen.append(m)
        refused = self._fuse(self._ticks[first].belief, m)
        if refused:
            self._ticks[first].seen.pop()
        else:
            self._redo(first, back)
        if position and not refused:
            self._watch.accept(now)
        elif position and self._watch.refuse():
            self._begin(m.value, now)

    def _correct_command(self, m: Measurement, now: float) -> None:
        """The drive reports where it really was."""
        back = round((now - m.stamp_s) / self.model.tick_s) if math.isfinite(m.value + m.stamp_s) else -1
        if not 0 <= back < self._count:
            self.counts.unusable += 1
            return
        off = m.value - self._ticks[(self._newest - back) % len(self._ticks)].told
        self._offset = off if abs(off) > _FOLLOWS * self.noise.carriage_std_m else 0.0

    def _follows(self, channel: str) -> bool:
        return channel in _CHANNEL_STATES and bool(self._drive_state) and self._count > 0

    def _fuse(self, belief: Belief, m: Measurement) -> bool:
        """Take `m` into a belief; whether it was refused."""
        if m.channel == "position_m":
            size = self._process.see_position(belief, m.value)
        else:
            size = self._process.see_state(belief, self._drive_state, m.value)
        return not size <= self.noise.gate

    def _redo(self, first: int, count: int) -> None:
        """Compute the `count` ticks after `first` again, with all that was measured in them."""
        for k in range(count):
            before = self._ticks[(first + k) % len(self._ticks)].belief
            tick = self._ticks[(first + k + 1) % len(self._ticks)]
            time_s, command = tick.belief.time_s, tick.belief.command
            tick.belief.copy_from(before)
            self._process.predict(tick.belief, command)
            tick.belief.time_s = time_s
            for m in tick.seen:
                self._fuse(tick.belief, m)

    def _begin(self, position_m: float, now: float) -> None:
        self._newest, self._count = 0, 1
        start = self._process.start(position_m, self.noise.position_std_m, self._command, now)
        self._ticks[0].belief.copy_from(start)
        self._ticks[0].told = self._command
        self._ticks[0].seen.clear()
        self._watch.begin(now)

    def _estimate(self, now: float) -> Estimate:
        if not self._count:
            nothing = np.full(len(self.model.states), math.nan)
            return Estimate(now, nothing, nothing, 0.0, True)
        belief = self._ticks[self._newest].belief
        std, sound = self._process.spread(belief)
        if not sound:
            self._count = 0
            self.counts.restarts += 1
            return self._estimate(now)
        adapted = self._process.adapted(belief)
        force = adapted.disturbance_N + self._process.lacking(belief, adapted.parameters)
        return Estimate(now, self._process.state(belief), std, force, self._watch.lost(now, float(std[0])), adapted)
