"""The guard between controller and bus: what leaves is allowed, finite, within range and slew, and in time."""

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
GUARD_REASON: Final = 2  # `Reason` of the guard's stop
LATE: Final = "controller late"


@dataclass(frozen=True, slots=True)
class Fence:
    """What a command is held to: range [`low`, `high`] and `rate` a second in the drive's unit. `rests`: the safe
    command is to stay (carriage), else it is 0. Feedback older than `feedback_s` less the time to brake at `braking` a
    second squared, or localisation older than `stop_s` stop the drive; localisation older than `derate_s` halves range
    or rate. One missing command is held, from the second on it fades, the `late_stop`-th stops. `first_share` of the
    rate (carriage) or range is there when the drive is enabled, and `growth` a second more until it is all (`after`).
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
        held = (e.low, e.high, e.rate, e.placed, tick_s, frame_map.feedback_s, frame_map.braking_m_s2)
        first, growth = limits.first_speed_m_s / speed, limits.first_acceleration_m_s2 / speed
        return cls(*held, stop_s=limits.age_s, first_share=first, growth=growth)

    def after(self, since_s: float) -> Fence:
        """The fence `since_s` s after the drive was enabled on a rig."""
        share = self.first_share + self.growth * max(since_s, 0.0)
        if share >= 1.0:
            return self
        if self.rests:
            return replace(self, rate=share * self.rate)
        return replace(self, low=share * self.low, high=share * self.high)


@dataclass(frozen=True, slots=True)
class Evidence:
    """Ages in s of the newest good localisation and drive feedback (inf: none), and the drive's `state`."""

    localisation_s: float
    feedback_s: float
    state: int


@dataclass(frozen=True, slots=True)
class Passed:
    """What the guard lets out; commands missing in a row; why it is not what was asked for."""

    value: float
    rate: float
    mode: int
    missed: int = 0
    reason: str = ""


def passed(wanted: object, mode: int, evidence: Evidence, before: Passed, dt: float, fence: Fence) -> Passed:
    """The command that may leave `dt` s after `before`. Never raises. Any mode but `ENABLE` moves nothing and passes. A
    stop holds until another mode than `ENABLE` has been asked for. A `wanted` that is no finite number is missing.
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
    held = _within(aim, reach * fence.low, reach * fence.high)
    dt = min(dt, 2 * fence.tick_s) if dt > 0 else 0.0
    if math.isfinite(fence.rate):
        most = fence.rate * (share if fence.rests else 1.0) * dt
        held = _within(held, before.value - most, before.value + most)
    rate = (held - before.value) / dt if dt > 0 else 0.0
    why = "late" if missed else "" if abs(held - aim) <= 1e-9 * (fence.high - fence.low) else "limit"
    return Passed(held, rate, ENABLE, missed, why)


def _stopping(evidence: Evidence, missed: int, rate: float, fence: Fence) -> str:
    """Why a drive that moves by `rate` a second must stop; what comes from the future shows a pause."""
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
    """The only one who sends for the controller: its frames, the drive's command through `passed`. `refused` counts
    what was not allowed or did not fit, `unsent` what the bus did not take. Where `dry` nothing is sent. `observe` sees
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
        """Send the command for `wanted`, `since_s` after the drive was enabled, and a safe stop beside the guard's."""
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
        """Send one frame of the whitelist; whether it went out."""
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
