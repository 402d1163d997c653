"""Checks of sensor and drive against each other: probe, contradictions, jumps, motion of a disabled drive."""

import math
from collections import Counter, deque
from collections.abc import Sequence
from typing import Final

from controller.limits import Envelope
from controller.monitor.monitor import Health
from controller.signals import Measurement, Reference
from controller.supervision.contradiction import Contradiction
from controller.supervision.fallback import not_led
from controller.supervision.probe import Probe
from controller.tuned import TOLD_S
from hil.nodes.frame_map import STANDBY, WAITING
from hil.nodes.view import sampled

_JUMP_M: Final = 2e-3  # step of the estimated position that is reported, and restarts the drive's rate
_ASTRAY: Final = 3  # consecutive ticks of motion: a single report may be an old one


class Onlooker:
    """Monitors a run: `begin` when the drive is enabled, `look` once per tick. `jumps` counts steps of the estimated
    position of 2 mm or more, the last one being `jump_m` at `cautious_s`. `led` counts ticks by active controller.
    `unrest` describes motion of a drive in standby or ready, "" without any.
    """

    def __init__(self, envelope: Envelope, rests: float, tick_s: float, noise_m: float, friction: float) -> None:
        """`rests` is `Driven.rests`; `friction` is the command that overcomes friction."""
        self._tick_s, self._placed = tick_s, envelope.placed
        self.contradiction = Contradiction(envelope, noise_m, friction)
        self._ticks = deque([(0.0, 0.0)], maxlen=2 + math.ceil(TOLD_S / tick_s))
        self.led: Counter[str] = Counter()
        self.unrest, self._rested, self._most = "", math.nan, rests
        self._astray = 0
        self.jumps, self.jump_m, self.cautious_s = 0, 0.0, -math.inf
        self._followed, self._believed_m = 0, math.nan

    @property
    def words(self) -> str:
        """The jumps in words, "" without any."""
        if not self.jumps:
            return ""
        last = f"the last of {1e3 * self.jump_m:+.1f} mm"
        return f"{self.jumps} jumps, {last}, accepted after three readings confirmed it"

    def not_led(self, wanted: str, health: Health) -> str:
        """Why a finished run was not led as requested, or how a jump broke the model; "" where all is well."""
        if self.jumps and health.state == "broken":
            return f"the model broke after the localisation had jumped: {self.words}"
        return not_led(self.led, wanted)

    def begin(self) -> None:
        """The drive is enabled: earlier motion of drive and capsule is forgotten."""
        self.contradiction.begin()
        self._ticks.clear()

    def look(
        self,
        now: float,
        drive: float,
        wanted_m: float,
        seen: Sequence[Measurement],
        late_s: float,
        reference: Reference,
        probe: Probe | None,
    ) -> str:
        """The reason to stop, "" without one. The readings `seen` were true `late_s` before their stamps."""
        self._ticks.append((drive, wanted_m))
        reason = self.contradiction.drove(drive, wanted_m, self._tick_s)
        for m in seen:
            if m.channel != "position_m" or not math.isfinite(m.value + m.stamp_s):
                continue
            stamp_s = m.stamp_s - late_s
            back = min(max(round((now - stamp_s) / self._tick_s), 0), len(self._ticks) - 1)
            then, position_m = self._ticks[-1 - back]
            reason = reason or self.contradiction.saw(m.value, then, position_m, stamp_s)
            if probe is not None:
                probe.saw(m.value, then, *sampled(reference, stamp_s))
        return reason

    def believe(self, now: float, position_m: float, followed: int) -> None:
        """The estimate is `position_m`; the estimator has accepted refused readings `followed` times."""
        step_m = position_m - self._believed_m
        self._believed_m = position_m
        if followed > self._followed and abs(step_m) >= _JUMP_M:
            self.jumps, self.jump_m, self.cautious_s = self.jumps + 1, step_m, now
        self._followed = followed

    def rests(self, state: int, still: float) -> None:
        """The drive is in `state`; `still` (`FrameReceiver.still`) must be constant while it is disabled."""
        if state not in (STANDBY, WAITING):
            self._rested = math.nan
            return
        if math.isnan(self._rested):
            self._rested = still if self._placed else 0.0
        self._astray = self._astray + 1 if abs(still - self._rested) > self._most else 0
        if self._astray >= _ASTRAY and not self.unrest:
            went, current = f"it moved by {1e3 * (still - self._rested):+.1f} mm", f"its current is {still:.2g} A"
            self.unrest = f"the drive does not rest: {went if self._placed else current} while it was not enabled"
