"""The Gaussian estimator: beliefs kept for a while, so that a late measurement is taken in where it belongs and what came after is redone."""

from __future__ import annotations

from dataclasses import dataclass, field

from controller.estimator.belief import Belief, Process
from controller.estimator.noise import Noise
from controller.estimator.receiver import Receiver
from controller.prediction import ControlModel
from controller.signals import Estimate, Measurement


@dataclass(slots=True)
class _Tick:
    """A tick that is kept: the belief at its end with all that was measured there, and what the drive was told."""

    belief: Belief
    told: float = 0.0
    seen: list[Measurement] = field(default_factory=list)


class Estimator(Receiver):
    """An unscented Kalman filter with the control model as its process.

    A late measurement is taken in at the tick of its stamp and the ticks since are computed again: their number, and so the time this
    takes, is bounded. Its points lie a standard deviation away, some stick while others slip: the mean glides where the capsule jumps.
    """

    def __init__(self, model: ControlModel, noise: Noise | None = None) -> None:
        super().__init__(model, noise)
        self._process = Process(model, self.noise)
        self._ticks = [_Tick(self._process.start(0.0, 1.0, 0.0, 0.0)) for _ in range(self._kept)]
        self._newest = 0
        self.reset(0.0, 0.0)

    def _at(self, back: int) -> _Tick:
        return self._ticks[(self._newest - back) % len(self._ticks)]

    def _begin(self, position_m: float, now: float) -> None:
        start = self._process.start(position_m, self.noise.position_std_m, self._command, now)
        self._at(0).belief.copy_from(start)
        self._at(0).told = self._command
        self._at(0).seen.clear()

    def _go_on(self, now: float, command: float) -> None:
        last = self._at(0).belief
        self._newest += 1
        tick = self._at(0)
        tick.belief.copy_from(last)
        tick.seen.clear()
        self._process.predict(tick.belief, command + self._offset)
        tick.belief.time_s = now
        tick.told = command

    def _told(self, back: int) -> float:
        return self._at(back).told

    def _fuse(self, back: int, m: Measurement) -> bool:
        taken = self._see(self._at(back).belief, m)
        if taken:
            self._at(back).seen.append(m)
            self._redo(back)
        return taken

    def _see(self, belief: Belief, m: Measurement) -> bool:
        if m.channel == "position_m":
            size = self._process.see_position(belief, m.value)
        else:
            size = self._process.see_state(belief, self.model.states[self._current or 0], m.value)
        return size <= self.noise.gate

    def _redo(self, back: int) -> None:
        """Compute the ticks since `back` ticks ago again, with all that was measured in them."""
        for k in range(back, 0, -1):
            tick = self._at(k - 1)
            time_s, command = tick.belief.time_s, tick.belief.command
            tick.belief.copy_from(self._at(k).belief)
            self._process.predict(tick.belief, command)
            tick.belief.time_s = time_s
            for m in tick.seen:
                self._see(tick.belief, m)

    def _estimate(self, now: float) -> Estimate | None:
        belief, process = self._at(0).belief, self._process
        std, sound = process.spread(belief)
        if not sound:
            return None
        force, adapted = process.adapted(belief)
        return Estimate(now, process.state(belief), std, force, self._watch.lost(now, float(std[0])), adapted)
