"""A drive's state machine: boot, self-test, standby, ready, enabled, derated, quick stop, fault; one pure step."""

import math
from dataclasses import dataclass, replace
from typing import Final

from hil.bus.protection import COUNTS
from hil.nodes import frame_map as wire
from hil.nodes.frame_map import NO_FAULT, TIME_TO_LIVE

BOOT_S: Final = 0.02  # of the simulated drive
SELF_TEST_S: Final = 0.03  # the same


@dataclass(frozen=True, slots=True)
class Stage:
    """Where a drive stands since `since_s`; `armed`: it has been told "off" in standby, and may become ready."""

    state: int = wire.BOOT
    since_s: float = 0.0
    fault: int = NO_FAULT
    armed: bool = False


@dataclass(frozen=True, slots=True)
class DriveFacts:
    """What a drive knows in one step: the newest command's `mode`, whether it is still `alive`, `safe_stop` while one
    is in force, codes of a `reset` and of a present `cause` (0: none), `hot` from its derating temperature on, whether
    it is `at_rest` in its safe state, and whether its challenge has been `answered`.
    """

    mode: int = wire.OFF
    alive: bool = False
    safe_stop: bool = False
    reset: int = NO_FAULT
    cause: int = NO_FAULT
    hot: bool = False
    at_rest: bool = True
    answered: bool = False


def next_stage(stage: Stage, told: DriveFacts, now: float) -> Stage:
    """The stage after one step at `now` in s. A cause for a fault latches it from everywhere. It ends by a reset that
    names it, once its cause is gone, in standby; from there "off", "ready" and "enable" lead up one by one, each while
    its command lives, "ready" only once the challenge has been answered.
    """
    if told.cause and not stage.fault:
        return Stage(wire.FAULT, now, told.cause)
    if stage.state == wire.FAULT:
        return Stage(wire.STANDBY, now) if told.reset == stage.fault and not told.cause and told.at_rest else stage
    state = _next_state(stage, told, now)
    if state == wire.FAULT:
        return Stage(wire.FAULT, now, TIME_TO_LIVE)
    if state == wire.STANDBY:
        off = told.alive and told.mode == wire.OFF
        return replace(stage, armed=stage.armed or off) if stage.state == wire.STANDBY else Stage(wire.STANDBY, now)
    return stage if state == stage.state else Stage(state, now)


def _next_state(stage: Stage, told: DriveFacts, now: float) -> int:
    if stage.state == wire.BOOT:
        return wire.SELF_TEST if now - stage.since_s >= BOOT_S else wire.BOOT
    if stage.state == wire.SELF_TEST:
        return wire.STANDBY if now - stage.since_s >= SELF_TEST_S else wire.SELF_TEST
    if stage.state == wire.STANDBY:
        wanted = stage.armed and told.answered and told.alive and told.mode == wire.READY and not told.safe_stop
        return wire.WAITING if wanted else wire.STANDBY
    if stage.state == wire.STOPPING:
        return wire.STANDBY if told.at_rest else wire.STOPPING
    if stage.state == wire.WAITING:
        if not told.alive or told.safe_stop or told.mode not in (wire.READY, wire.ENABLE):
            return wire.STANDBY
        return wire.WAITING if told.mode == wire.READY else wire.ENABLED
    if not told.alive:
        return wire.FAULT
    if told.safe_stop or told.mode != wire.ENABLE:
        return wire.STOPPING
    return wire.DERATED if told.hot else wire.ENABLED


def may_move(stage: Stage) -> bool:
    """Whether the drive follows its commands."""
    return stage.state in wire.MOVING


DRIFT: Final = 5e-4
"""Share by which two clocks may go apart; what comes later by less than that each second is not told from them."""
SILENCE_S: Final = 0.06  # A controller without SYNC for so long counts as another one


class SyncClock:
    """Tick n of period T begins at o + n T, where o is the least of `stamp - n T` over the SYNC frames so far. It grows
    by `DRIFT` a second, and begins anew once SYNC has been silent. While it lives no other time is let in: a SYNC that
    counts back, or whose tick would have begun more than `SILENCE_S` off, is another controller's or a recording.

    A command belongs to the SYNC with its own counter of 4 bits, so one that is 16 ticks late from the beginning on is
    not told.
    """

    def __init__(self) -> None:
        self._offset = math.inf
        self._stamp = -math.inf
        self._tick, self._counter, self._period_s = -1, 0, 0.0

    def sync(self, counter: int, tick: int, period_s: float, stamp: float) -> bool:
        """SYNC number `tick` came at `stamp`; whether it was let in."""
        if not 0 <= stamp - self._stamp <= SILENCE_S:
            self._offset = math.inf
        elif tick <= self._tick or abs(stamp - self._offset - tick * period_s) > SILENCE_S:
            return False
        self._offset = min(self._offset + DRIFT * (stamp - self._stamp), stamp - tick * period_s)
        self._tick, self._counter, self._period_s, self._stamp = tick, counter, period_s, stamp
        return True

    def begin(self, counter: int, stamp: float) -> float:
        """When the tick began of the command with this `counter` that came at `stamp`."""
        if self._tick < 0:
            return stamp
        ahead = (counter - self._counter) % COUNTS
        room = (stamp - self._stamp) / self._period_s + 0.5
        ticks = ahead + COUNTS * math.floor((room - ahead) / COUNTS)
        return self._offset + (self._tick + ticks) * self._period_s
