"""The best controller that works, else the next, else a controlled stop; every command passes the limits last."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from controller.estimator.base import Observer
from controller.limits import Envelope, Issued, Seen, limited, number
from controller.model.control_model import ControlModel
from controller.registry import Chain, build, estimator_for
from controller.signals import Action, Array, Controller, Estimate, Reference, Status
from controller.supervision.acceptance import Acceptance
from controller.supervision.fallback import Blend, Event, FallbackChain, Rules, Swings

SERIOUS = frozenset({"range", "gap", "speed", "temperature"})
_EVENTS = 256  # newest events that are kept
_FORGOTTEN = 0.5  # s of oscillation far from the aim that a second of following cancels
_FULL = 0.99  # share of the full rate above which a carriage moves at full rate
_NO_ACTION = Action(math.nan, "failed")


class Supervisor:
    """A controller made of a `chain` of controllers, best first, and a controlled stop below them.

    Each tick asks the best one that is not suspended. One that raises, answers with no finite number, `failed`, `lost`
    or `stopped`, or `late` more than `late_allowed` times in a row, is suspended; the next one is asked in the same
    tick. Without any, or with a lost estimate, the drive stops: carriage at rest, current and inner mass to 0.

    A controller that takes over is reset to the command in force; the step between them fades. Nothing here raises; the
    drive's time to live covers a controller that never returns. `temperature_C` is the drive's last report, `room` the
    least and greatest command for now, between which a stop still goes to 0.
    """

    name = "supervised"

    def __init__(
        self,
        chain: Sequence[Controller],
        envelope: Envelope,
        rules: Rules | None = None,
        *,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        if not chain:
            raise ValueError("chain must have one controller or more; got none")
        self.envelope = envelope
        self.rules = Rules() if rules is None else rules
        self.temperature_C = 20.0
        self.events: deque[Event] = deque(maxlen=_EVENTS)
        self.issued = Issued(envelope.neutral(math.nan))
        self._clock = clock
        bounded = math.isfinite(envelope.acceleration)
        self._braking_m = 0.5 * envelope.rate**2 / envelope.acceleration if bounded else math.inf
        self.halted, self.room = "", (-math.inf, math.inf)
        self._offered: tuple[Controller, ...] | None = None
        self._allowed: int | None = None
        self._led = ""
        self._begin(tuple(chain), 0.0)

    def _begin(self, chain: tuple[Controller, ...], now: float) -> None:
        self._fallback = FallbackChain(len(chain), self.rules)
        self._blend = Blend(self.rules.blend_s)
        self._chain, self._now, self._elapsed, self._tick = chain, now, 0.0, 0.0
        self._active = -1
        self._late = 0
        self._cut_after: int | None = None
        self._reason = "start"
        self._bad_until, self._rest_since, self._limited_since = -math.inf, math.inf, math.inf
        self._resting_s = -math.inf
        self._unfollowed_s = 0.0
        self._swings = Swings(math.inf if self.envelope.shaken else self.rules.swing_m, self.rules.swing_s)
        self._stopped_at, self._stop_from = math.inf, 0.0

    @property
    def active(self) -> str:
        """Name of the controller in charge; "stop" without one."""
        return self._chain[self._active].name if 0 <= self._active < len(self._chain) else "stop"

    @property
    def first(self) -> str:
        return self._chain[0].name

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """Begin at `now` with `command` in force; a command outside the limits counts as the nearest one inside."""
        self.halted = ""
        self.issued, _ = limited(math.nan, Issued(number(command)), self._seen(now, estimate), 0.0, self.envelope)
        self._begin(self._chain, number(now))

    def chain_for(self, name: str, model: ControlModel, deadline_s: float) -> Chain:
        """The controllers named `name` of another `model`, to take over later. Errors as `build`."""
        return build(name, model, self.envelope, deadline_s)

    def observer_for(self, name: str, model: ControlModel, estimator: str) -> Observer:
        """The estimator of the controller `name` of `model`, `estimator` one of `ESTIMATORS`."""
        return estimator_for(name, model, estimator, self.envelope.limits.age_s)

    def offer(self, chain: Sequence[Controller], verdict: Acceptance) -> bool:
        """Keep `chain`, the controllers of a new model, for `take_offered` if its `verdict` passed; whether it did."""
        if verdict.passed and chain:
            self._offered = tuple(chain)
            return True
        self._note("offer", f"refused: {verdict.sentence}")
        return False

    def take_offered(self) -> bool:
        """Take the offered chain over if capsule and reference have been at rest long enough; whether so."""
        if self._offered is None or not self._resting_s >= self.rules.rest_s:
            return False
        chain, self._offered = self._offered, None
        self._begin(chain, self._now)
        self._reason = "new model"
        return True

    def lead_on(self, chain: Sequence[Controller], reason: str) -> None:
        """Take `chain`, the controllers of a better model, over at once; the step between the commands fades."""
        before = self.active
        self._begin(tuple(chain), self._now)
        self._reason, self._led = reason, before

    def halt(self, reason: str) -> None:
        self.halted = self.halted or reason

    def allow(self, steps: int | None) -> None:
        """Pass the number of steps that the clock once allowed to the next controller asked."""
        self._allowed = steps

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        """The command for the tick at `now` in s, within the limits, with status and path of its controller."""
        dt = number(now) - self._now
        self._now = number(now) if math.isfinite(number(now)) else self._now
        tick = min(max(dt, 0.0), self.envelope.limits.longest_tick_s) if math.isfinite(dt) else 0.0
        self._elapsed, self._tick = self._elapsed + tick, tick
        seen, self._cut_after = self._seen(now, estimate), None
        self._watch_rest(seen, reference)
        action, status = self._decide(seen, now, estimate, reference)
        low, high = self.room if self._active >= 0 else (min(self.room[0], 0.0), max(self.room[1], 0.0))
        self.issued, broken = limited(min(max(action.command, low), high), self.issued, seen, tick, self.envelope)
        self._watch_limits(broken)
        self._watch_swings(seen, reference)
        self._allowed = None
        if broken and status == "ok":
            status = "limited"
        return Action(self.issued.command, status, action.predicted, action.timings, self._cut_after)

    def _decide(self, seen: Seen, now: float, estimate: Estimate, reference: Reference) -> tuple[Action, Status]:
        if self.halted:
            return self._stop(self.halted), "stopped"
        fresh = seen.age_s <= self.envelope.limits.age_s and math.isfinite(seen.position_m + seen.speed_m_s)
        blind = seen.lost or not fresh
        if blind:
            self._bad_until = self._elapsed + self.rules.settle_s
        if blind or self._elapsed < self._bad_until:
            return self._stop("estimate lost"), "lost"
        worst: Status = "ok"
        for rank in self._fallback.open(self._elapsed):
            action, fault = self._asked(rank, now, estimate, reference)
            if fault is None:
                self._fallback.worked(rank, self._elapsed)
                command = self._blend.smooth(action.command, self._elapsed)
                smooth = Action(command, action.status, action.predicted, action.timings)
                return smooth, action.status if worst == "ok" else worst
            worst = "late" if fault == "late" else "failed"
            self._reason = f"{self._chain[rank].name} {fault}"
            self._fallback.failed(rank, self._elapsed)
        return self._stop(self._reason), "stopped"

    def _asked(self, rank: int, now: float, estimate: Estimate, reference: Reference) -> tuple[Action, str | None]:
        controller, changed = self._chain[rank], rank != self._active
        began = self._clock()
        try:
            if changed:
                controller.reset(now, estimate, self.issued.command)
            if self._allowed is not None:
                controller.allow(self._allowed)
            controller.follow(self.issued.command - (0.0 if changed else self._blend.left), self.issued.rate)
            action = controller.act(now, estimate, reference)
            command, status = number(action.command), action.status
        except Exception as error:  # noqa: BLE001 - whatever a controller does, the drive gets a safe command
            return _NO_ACTION, f"raised {type(error).__name__}"
        if not math.isfinite(command) or status not in ("ok", "late", "limited"):
            return _NO_ACTION, f"answered {status}" if math.isfinite(command) else "answered no number"
        self._cut_after = action.cut_after if self._cut_after is None else self._cut_after
        late = status == "late" or self._clock() - began > self.rules.deadline_s
        self._late = self._late + 1 if late and not changed else int(late)
        if self._late > self.rules.late_allowed:
            return _NO_ACTION, "late"
        if changed:
            self._hand_over(rank, command)
        return Action(command, "late" if late else status, action.predicted, action.timings), None

    def _hand_over(self, rank: int, command: float) -> None:
        self._note(self._chain[rank].name, "tried again" if 0 <= rank < self._active else self._reason)
        self._active, self._stopped_at = rank, math.inf
        if not self.envelope.shaken:
            running = self.issued.rate * self._tick if self.envelope.placed else 0.0
            self._blend.begin(self.issued.command + running - command, self._elapsed)

    def _stop(self, reason: str) -> Action:
        """The safe state of the drive; a current ramps down from its value at the stop."""
        if self._stopped_at == math.inf:
            self._note("stop", reason)
            self._reason = "recovered"
            self._active, self._late, self._stopped_at, self._stop_from = -1, 0, self._elapsed, self.issued.command
        if self.envelope.placed:
            return Action(self.issued.command, "stopped")
        since = self._elapsed - self._stopped_at
        fades = not self.envelope.shaken and self.rules.stop_s > 0
        left = max(0.0, 1 - since / self.rules.stop_s) if fades else 0.0
        return Action(left * self._stop_from, "stopped")

    def _watch_limits(self, broken: Sequence[str]) -> None:
        """Serious limits in force too long are a failure, as are commands that no carriage can follow."""
        if self._active < 0 or not SERIOUS.intersection(broken):
            self._limited_since = math.inf
        elif self._limited_since == math.inf:
            self._limited_since = self._elapsed
        elif self._elapsed - self._limited_since >= self.rules.limit_s:
            self._too_long(SERIOUS.intersection(broken))
        # in a normal move a carriage farther from its aim than its braking distance moves at full rate
        turning = float(abs(self.issued.rate) < _FULL * self.envelope.rate)
        counted = turning if abs(self.issued.aim - self.issued.command) > self._braking_m else -_FORGOTTEN
        self._unfollowed_s = 0.0 if self._active < 0 else max(0.0, self._unfollowed_s + counted * self._tick)
        if self._unfollowed_s >= self.rules.limit_s:
            self._too_long({"rate"})

    def _too_long(self, names: Iterable[str]) -> None:
        self._reason = f"{self.active} limited too long: {', '.join(sorted(names))}"
        self._fallback.failed(self._active, self._elapsed)
        self._limited_since, self._unfollowed_s = math.inf, 0.0

    def _watch_swings(self, seen: Seen, reference: Reference) -> None:
        """A controller that swings far and often must reduce its gain; one that cannot is banned with this model."""
        error_m = math.nan if seen.lost else seen.position_m - _at(lambda t: reference.position(t), self._now)
        if self._active < 0:
            return
        far = self._swings.see(self._elapsed, error_m) >= self.rules.swings
        if not far and not self._swings.growing:
            return
        reason = f"{self.active} swings about the reference"
        try:
            calmed = bool(self._chain[self._active].calm())
        except Exception:  # noqa: BLE001 - a controller that raises cannot reduce its gain
            calmed = False
        if calmed or far:
            self._swings.forget()
        if calmed:
            self._note(self.active, reason)
        if calmed or not far:
            return
        self._reason = reason
        self._fallback.ban(self._active)
        if self._fallback.banned:
            self.halt(f"no controller is left: {reason}")

    def _watch_rest(self, seen: Seen, reference: Reference) -> None:
        speeds = (seen.speed_m_s, _at(lambda t: reference.speed(t), self._now))
        resting = not seen.lost and all(abs(speed) <= self.rules.rest_speed_m_s for speed in speeds)
        self._rest_since = min(self._rest_since, self._elapsed) if resting else math.inf
        self._resting_s = self._elapsed - self._rest_since

    def _seen(self, now: float, estimate: Estimate) -> Seen:
        """The capsule in the estimate; lost if unreadable."""
        try:
            x, v = number(estimate.state[0]), number(estimate.state[1])
            age, lost = number(now) - number(estimate.time_s), bool(estimate.lost)
            std = number(estimate.std[0])
        except Exception:  # noqa: BLE001 - an unreadable estimate is lost
            return Seen(math.nan, math.nan, math.inf, True, self.temperature_C)
        early = -self.envelope.limits.longest_tick_s
        return Seen(x, v, max(age, 0.0) if age >= early else math.inf, lost, self.temperature_C, std)

    def _note(self, after: str, reason: str) -> None:
        """The next event: a chain that led on takes over from who led before it."""
        self.events.append(Event(self._now, self._led or self.active, after, reason))
        self._led = ""


def _at(profile: Callable[[Array], Array], now: float) -> float:
    """The reference's value at `now`; nan if unreadable, which is neither at rest nor off."""
    try:
        return number(np.ravel(profile(np.array([now])))[0])
    except Exception:  # noqa: BLE001 - an unreadable reference has no value
        return math.nan
