"""Plausibility checks of the controller node: sensor, drive, and both against each other."""

import math
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from controller.limits import Envelope
from controller.monitor import Health
from controller.signals import Measurement, Reference
from controller.supervision.breakaway import Resistance
from controller.supervision.contradiction import CONFIRMED, Contradiction
from controller.supervision.fallback import not_led
from controller.supervision.probe import Probe
from controller.tuned import OLDEST_S
from hil.nodes.frame_map import STANDBY, WAITING
from hil.nodes.view import sampled

CHANCE: Final = 1e-7  # probability that a sound sensor's readings are equal so often that they count as stuck
STEP_M: Final = 2e-7  # step of the position on the bus: no localisation is finer
LONGEST: Final = 500  # largest number of equal readings that is asked for: 5 s of a sensor that reads every 10 ms
FARTHEST_M: Final = 0.01
"""Distance of the reference, beyond two steps of the sensor, after which the reading must have changed."""


def readings_alike(noise_m: float, resolution_m: float) -> float:
    """How many equal readings in a row mean a stuck sensor. White noise of standard deviation s (`noise_m`) stays
    within a step r (`resolution_m`) with the probability `p = erf(r/(2 sqrt(2) s))` at most, so n readings are equal
    with `p^(n - 1)`. Above `LONGEST`, or without noise, it is inf: so coarse a sensor may stay constant.
    """
    if noise_m <= 0:
        return math.inf
    stays = math.erf(max(resolution_m, STEP_M) / (2 * math.sqrt(2) * noise_m))
    count = 1 + math.ceil(math.log(CHANCE) / math.log(stays)) if stays < 1 else math.inf
    return count if count <= LONGEST else math.inf


@dataclass
class Plausibility:
    """The drive does not follow if, for `follow_ticks` in a row, its report is farther than `follow` from the commands
    of the last `lag_ticks` (in their unit), or unchanged to the last bit though the command moved by `follow`/10.

    The localisation is stuck if its readings (noise `noise_m`, steps `resolution_m`) are equal for longer than chance
    allows (`readings_alike`), or while the reference moves by `FARTHEST_M` and two steps.
    """

    follow: float
    noise_m: float = 5e-4
    resolution_m: float = 0.0
    lag_ticks: int = 1
    follow_ticks: int = 5
    alike: int = 0
    off: int = 0
    frozen: int = 0
    restarts: int = 0
    _last: float = math.nan
    _report: float = math.nan
    _commanded: float = math.nan
    _least: float = math.inf
    _most: float = -math.inf

    def __post_init__(self) -> None:
        self._stuck = readings_alike(self.noise_m, self.resolution_m)
        self._way_m = FARTHEST_M + 2 * self.resolution_m
        self._commands: deque[float] = deque(maxlen=self.lag_ticks)

    def saw(self, value: float) -> None:
        same = value == self._last
        self.alike = self.alike + 1 if same else 1
        self._last = value
        if not same:
            self._least, self._most = math.inf, -math.inf

    def wanted(self, position_m: float) -> None:
        self._least, self._most = min(self._least, position_m), max(self._most, position_m)

    def tick(self, command: float, reports: Sequence[float]) -> None:
        """The drive was sent `command` and has sent `reports`, the newest last."""
        self._commands.append(command)
        if not reports:
            return
        newest = reports[-1]
        near = min(self._commands) - self.follow <= newest <= max(self._commands) + self.follow
        self.off = 0 if near and math.isfinite(command) else self.off + 1
        if newest != self._report:
            self._report, self._commanded = newest, command
        self.frozen = self.frozen + 1 if abs(command - self._commanded) > self.follow / 10 else 0

    def settle(self, restarts: int) -> None:
        """Reset for a drive at rest and an estimator that has restarted `restarts` times."""
        self.off, self.frozen, self.restarts = 0, 0, restarts
        self._commands.clear()
        self._least, self._most = math.inf, -math.inf

    def reason(self, restarts: int) -> str:
        """The reason to stop, "" without one; the estimator has restarted `restarts` times."""
        if self.alike >= self._stuck or self._most - self._least > self._way_m:
            return "localisation stuck"
        if max(self.off, self.frozen) >= self.follow_ticks:
            return "drive does not follow"
        if restarts > self.restarts:
            return "localisation jumped"
        return ""


_JUMP_M: Final = 2e-3  # step of the estimate that restarts the drive's rate; of the readings, that is reported
_ASTRAY: Final = 3  # consecutive ticks of motion: a single report may be an old one


class Onlooker:
    """Monitors a run: `begin` when the drive is enabled, `look` once per tick. `cautious_s` is the time of the last
    step of the estimated position of 2 mm or more. `jumps` counts those at which the readings stepped as far, the last
    time by `jump_m`; behind a drive that lags the estimate alone steps. `led` counts ticks by active controller.
    `unrest` describes motion of a drive in standby or ready, "" without any.
    """

    def __init__(self, envelope: Envelope, rests: float, tick_s: float, noise_m: float, resistance: Resistance) -> None:
        """`rests` is `Driven.rests`, `resistance` that of a coil's capsule."""
        self._tick_s, self._placed = tick_s, envelope.placed
        self.contradiction = Contradiction(envelope, noise_m, resistance)
        self._ticks = deque[tuple[float, float, float]](maxlen=2 + math.ceil(OLDEST_S / tick_s))
        self.led: Counter[str] = Counter()
        self.unrest, self._rested, self._most = "", math.nan, rests
        self._astray = 0
        self.jumps, self.jump_m, self.cautious_s = 0, 0.0, -math.inf
        self._followed, self._believed_m = 0, math.nan
        self._readings = deque[float](maxlen=2 * CONFIRMED)

    @property
    def words(self) -> str:
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
        """The reason to stop, "" without one. The readings `seen` were true `late_s` before their stamps. The probe
        gets those during which the node ticked: where the drive was in a gap of the ticks, nobody has seen.
        """
        self._ticks.append((now, drive, wanted_m))
        reason = self.contradiction.drove(drive, wanted_m, self._tick_s)
        for m in seen:
            if m.channel != "position_m" or not math.isfinite(m.value + m.stamp_s):
                continue
            stamp_s = m.stamp_s - late_s
            latest_s = stamp_s + 0.5 * self._tick_s
            at_s, then, position_m = next((row for row in reversed(self._ticks) if row[0] <= latest_s), self._ticks[0])
            reason = reason or self.contradiction.saw(m.value, then, position_m, stamp_s)
            if probe is not None and stamp_s - at_s <= 2 * self._tick_s:
                probe.saw(m.value, then, *sampled(reference, stamp_s))
        return reason

    def believe(self, now: float, position_m: float, followed: int, seen: Sequence[Measurement]) -> None:
        """The estimate after the readings `seen`; `followed` counts accepted refused readings."""
        self._readings.extend(m.value for m in seen if m.channel == "position_m" and math.isfinite(m.value))
        step_m = position_m - self._believed_m
        self._believed_m = position_m
        if followed > self._followed and abs(step_m) >= _JUMP_M:
            self.cautious_s = now
            if abs(jump_m := self._stepped_m()) >= _JUMP_M:
                self.jumps, self.jump_m = self.jumps + 1, jump_m
        self._followed = followed

    def _stepped_m(self) -> float:
        """How far the newest `CONFIRMED` readings are from those before; 0 where a steady motion explains it."""
        if len(self._readings) < 2 * CONFIRMED:
            return 0.0
        before, after = list(self._readings)[:CONFIRMED], list(self._readings)[CONFIRMED:]
        step_m, moved_m = (sum(after) - sum(before)) / CONFIRMED, after[-1] - after[0] + before[-1] - before[0]
        return step_m if abs(step_m) > abs(moved_m) else 0.0

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
