"""A drive's state machine, as one pure step, and its sync clock, which detects late commands."""

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
    """The state of a drive since `since_s`; `armed`: it was commanded "off" in standby and may become ready."""

    state: int = wire.BOOT
    since_s: float = 0.0
    fault: int = NO_FAULT
    armed: bool = False


@dataclass(frozen=True, slots=True)
class DriveFacts:
    """The inputs of one step: the newest command's `mode` and whether it is still `alive`, an active `safe_stop`, the
    codes of a `reset` and of a present fault's `cause` (0: none), `hot` above the derating temperature, `at_rest` in
    the safe state, and whether the challenge was `answered`.
    """

    mode: int = wire.OFF
    alive: bool = False
    safe_stop: bool = False
    reset: int = NO_FAULT
    cause: int = NO_FAULT
    hot: bool = False
    at_rest: bool = True
    answered: bool = False


def next_stage(stage: Stage, facts: DriveFacts, now: float) -> Stage:
    """The stage after one step at `now` in s. The cause of a fault latches it in every state. A reset with its code
    ends it in standby, once the cause is gone. From there "off", "ready" and "enable" lead up one by one, each while
    its command is alive; "ready" also needs the answer to the challenge.
    """
    if facts.cause and not stage.fault:
        return Stage(wire.FAULT, now, facts.cause)
    if stage.state == wire.FAULT:
        return Stage(wire.STANDBY, now) if facts.reset == stage.fault and not facts.cause and facts.at_rest else stage
    state = _next_state(stage, facts, now)
    if state == wire.FAULT:
        return Stage(wire.FAULT, now, TIME_TO_LIVE)
    if state == wire.STANDBY:
        off = facts.alive and facts.mode == wire.OFF
        return replace(stage, armed=stage.armed or off) if stage.state == wire.STANDBY else Stage(wire.STANDBY, now)
    return stage if state == stage.state else Stage(state, now)


def _next_state(stage: Stage, facts: DriveFacts, now: float) -> int:
    if stage.state == wire.BOOT:
        return wire.SELF_TEST if now - stage.since_s >= BOOT_S else wire.BOOT
    if stage.state == wire.SELF_TEST:
        return wire.STANDBY if now - stage.since_s >= SELF_TEST_S else wire.SELF_TEST
    if stage.state == wire.STANDBY:
        ready = stage.armed and facts.answered and facts.alive and facts.mode == wire.READY and not facts.safe_stop
        return wire.WAITING if ready else wire.STANDBY
    if stage.state == wire.STOPPING:
        return wire.STANDBY if facts.at_rest else wire.STOPPING
    if stage.state == wire.WAITING:
        if not facts.alive or facts.safe_stop or facts.mode not in (wire.READY, wire.ENABLE):
            return wire.STANDBY
        return wire.WAITING if facts.mode == wire.READY else wire.ENABLED
    if not facts.alive:
        return wire.FAULT
    if facts.safe_stop or facts.mode != wire.ENABLE:
        return wire.STOPPING
    return wire.DERATED if facts.hot else wire.ENABLED


DRIFT: Final = 5e-4  # Relative drift allowed between two clocks; a delay that grows more slowly looks like drift
SILENCE_S: Final = 0.06  # without SYNC, after which the next one may be another controller's


class SyncClock:
    """The controller's ticks on a drive's own clock. Tick n of period T begins at o + n T, where o is the least
    `stamp - n T` of the SYNC frames so far; it grows by `DRIFT` per second and is reset after a silence. A SYNC that
    counts back, or whose tick would begin more than `SILENCE_S` off, is refused: it is another controller's or a
    recording.

    A command belongs to the SYNC with its counter of 4 bits, so a constant delay of 16 ticks is not detected.
    """

    def __init__(self) -> None:
        self._offset = math.inf
        self._stamp = -math.inf
        self._tick, self._counter, self._period_s = -1, 0, 0.0

    def sync(self, counter: int, tick: int, period_s: float, stamp: float) -> bool:
        if not 0 <= stamp - self._stamp <= SILENCE_S:
            self._offset = math.inf
        elif tick <= self._tick or abs(stamp - self._offset - tick * period_s) > SILENCE_S:
            return False
        self._offset = min(self._offset + DRIFT * (stamp - self._stamp), stamp - tick * period_s)
        self._tick, self._counter, self._period_s, self._stamp = tick, counter, period_s, stamp
        return True

    def begin(self, counter: int, stamp: float) -> float:
        """The begin of the tick of a command with this `counter`, received at `stamp`."""
        if self._tick < 0:
            return stamp
        ahead = (counter - self._counter) % COUNTS
        room = (stamp - self._stamp) / self._period_s + 0.5
        ticks = ahead + COUNTS * math.floor((room - ahead) / COUNTS)
        return self._offset + (self._tick + ticks) * self._period_s
