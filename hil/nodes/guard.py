"""The guard between controller and bus: every sent command is allowed, finite, in range, in slew rate and in time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import can

from controller.limits import Envelope, number
from hil.bus.protection import Sender
from hil.nodes.frame_map import (
    ENABLE,
    FRAME_MAPS,
    MOVING,
    QUICK_STOP,
    WAITING,
    FrameMap,
    Observer,
    controllers_frames,
    frames,
)

STOP_PERIOD_S: Final = 0.02  # between two frames of a safe stop
GUARD_REASON: Final = 2  # `Reason` of the guard's SafeStop
LATE: Final = "controller late"


@dataclass(frozen=True, slots=True)
class Fence:
    """The limits of a command: range [`low`, `high`] and `rate` per second, in the drive's unit. The safe command is to
    stay where `rests` (carriage), else 0.

    Feedback older than `feedback_s` less the time to brake (deceleration `braking`) stops the drive, and so does
    localisation older than `stop_s`; localisation older than `derate_s` halves range or rate. The first missing command
    is replaced by the last one, the next one by half of it; the `late_stop`-th stops. An enabled drive begins with
    `first_share` of its rate (carriage) or range, which grows by `growth` per second (`after`).
    """

    low: float
    high: float
    rate: float
    rests: bool
    tick_s: float
    feedback_s: float
    braking: float = math.inf
    derate_s: float = 0.05
    stop_s: float = 0.15
    late_stop: int = 3
    first_share: float = 1.0
    growth: float = math.inf

    @classmethod
    def of(cls, envelope: Envelope, frame_map: FrameMap, tick_s: float) -> Fence:
        e, limits, speed = envelope, envelope.limits, envelope.limits.carriage_speed_m_s
        basis = (e.low, e.high, e.rate, e.placed, tick_s, frame_map.feedback_s, frame_map.braking_m_s2)
        first, growth = limits.first_speed_m_s / speed, limits.first_acceleration_m_s2 / speed
        return cls(*basis, stop_s=limits.age_s, first_share=first, growth=growth)

    def after(self, since_s: float) -> Fence:
        share = self.first_share + self.growth * max(since_s, 0.0)
        if share >= 1.0:
            return self
        if self.rests:
            return replace(self, rate=share * self.rate)
        return replace(self, low=share * self.low, high=share * self.high)


@dataclass(frozen=True, slots=True)
class Evidence:
    """Ages in s of the newest good localisation and drive feedback (inf: none yet), and the drive's `state`."""

    localisation_s: float
    feedback_s: float
    state: int


@dataclass(frozen=True, slots=True)
class Passed:
    """The command that the guard sends, the count of missing commands in a row, why it differs from the request."""

    value: float
    rate: float
    mode: int
    missed: int = 0
    reason: str = ""


def passed(wanted: object, mode: int, evidence: Evidence, before: Passed, dt: float, fence: Fence) -> Passed:
    """The permitted command `dt` s after `before`. Never raises. Modes other than `ENABLE` move nothing and pass. A
    stop is latched until a mode other than `ENABLE` is requested. A non-finite `wanted` counts as missing.
    """
    aim = number(wanted)
    here = _within(aim, fence.low, fence.high) if fence.rests and math.isfinite(aim) else _rest(before.value, fence)
    if mode != ENABLE:
        return Passed(here, 0.0, mode)
    missed = 0 if math.isfinite(aim) else before.missed + 1
    reason = before.reason if before.mode == QUICK_STOP else _stopping(evidence, missed, before.rate, fence)
    if reason:
        return Passed(_rest(before.value, fence), 0.0, QUICK_STOP, missed, reason)
    if missed:
        aim = before.value if missed == 1 or fence.rests else 0.5 * before.value
    share = 1.0 if evidence.localisation_s <= fence.derate_s else 0.5
    reach = share if not fence.rests else 1.0
    limited = _within(aim, reach * fence.low, reach * fence.high)
    dt = min(dt, 2 * fence.tick_s) if dt > 0 else 0.0
    if math.isfinite(fence.rate):
        most = fence.rate * (share if fence.rests else 1.0) * dt
        limited = _within(limited, before.value - most, before.value + most)
    rate = (limited - before.value) / dt if dt > 0 else 0.0
    why = "late" if missed else "" if abs(limited - aim) <= 1e-9 * (fence.high - fence.low) else "limit"
    return Passed(limited, rate, ENABLE, missed, why)


def _stopping(evidence: Evidence, missed: int, rate: float, fence: Fence) -> str:
    """Why a drive that moves by `rate` per second must stop, "" without a reason. A stamp in the future is a pause."""
    if missed >= fence.late_stop or min(evidence.feedback_s, evidence.localisation_s) < -fence.tick_s:
        return LATE
    if not evidence.feedback_s <= fence.feedback_s - abs(rate) / fence.braking:
        return "feedback lost"
    if evidence.state != WAITING and evidence.state not in MOVING:
        return "drive not enabled"
    if not evidence.localisation_s <= fence.stop_s:
        return "localisation lost"
    return ""


def _rest(value: float, fence: Fence) -> float:
    return value if fence.rests else 0.0


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


class Guard:
    """Sends all frames of the controller; the drive's command goes through `passed`. `refused` counts frames that were
    not allowed or did not fit, `unsent` those that the bus did not take. With `dry` nothing is sent. `observe` gets
    each frame that was sent, or would have been. No method raises.
    """

    def __init__(
        self, bus: can.BusABC, frame_map: FrameMap, fence: Fence, *, dry: bool = False, observe: Observer | None = None
    ) -> None:
        self.fence, self.frame_map, self.dry = fence, frame_map, dry
        self.refused: Counter[str] = Counter()
        self.unsent = 0
        self.sent = Passed(0.0, 0.0, 0)
        self._bus, self._observe = bus, observe
        others = {one.command for one in FRAME_MAPS.values()} - {frame_map.command}
        own = set(controllers_frames().values()) - others
        self._senders = {name: Sender(frames()[name]) for name in own}
        self._time = self._stopped_at = -math.inf

    def command(self, now: float, wanted: object, mode: int, evidence: Evidence, since_s: float = math.inf) -> Passed:
        """Send the command for `wanted`, `since_s` after the drive was enabled; a stop is sent with a SafeStop."""
        fence = self.fence.after(since_s)
        out = passed(wanted, mode, evidence, self.sent, now - self._time, fence)
        self._time, self.sent = now, out
        self.send(self.frame_map.command, self.frame_map.values(out.value, out.rate, out.mode), now)
        if out.mode != QUICK_STOP:
            self._stopped_at = -math.inf
        elif not 0 <= now - self._stopped_at < STOP_PERIOD_S - 0.5 * self.fence.tick_s:
            self._stopped_at = now
            self.send("SafeStop", {"Target": self.frame_map.target, "Reason": GUARD_REASON}, now)
        return out

    def send(self, name: str, values: Mapping[str, float], now: float) -> bool:
        try:
            message = self._senders[name].message(values, now)
        except (KeyError, ValueError):
            self.refused[name] += 1
            return False
        if not self.dry:
            try:
                self._bus.send(message, timeout=0)
            except Exception:  # noqa: BLE001 - drivers of many makers raise whatever they like
                self.unsent += 1
                return False
        if self._observe is not None:
            self._observe(message)
        return not self.dry
