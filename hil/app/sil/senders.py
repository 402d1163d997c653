"""Senders beside the controller in simulated time: the operator of `[jog]`, a second operator, a false controller."""

import contextlib
import itertools
import math
from collections.abc import Sequence
from typing import Final

import can

from hil.app.scenario.bus_scenario import JogTable, Step
from hil.bus.protection import FrameTransmitter
from hil.nodes.frame_map import ENABLE, FrameMap, controllers_frames, frames, heartbeat
from hil.nodes.operator import SETPOINT
from hil.nodes.operator_sender import CYCLE_S, OperatorSender
from hil.simulated.medium import Medium, SimulatedBus

_AFTER_S: Final = 7e-3  # by which the second operator begins after its fault
_RELEASED_S: Final = 2 * CYCLE_S  # for which it sends a release first
_BACK_M_S: Final = -0.4  # speed that it asks for then, as fast backwards as the frame allows
_SECOND: Final = (Step("release", 0.0, _AFTER_S + _RELEASED_S), Step("speed", _BACK_M_S, math.inf))


class ScriptedOperator:
    """Sends one setpoint of `steps`, which count from `origin_s` (nan: the first call) on, in each cycle as `source`,
    the first `after_s` later. `presses` counts presses; after `let_go` it stays released.
    """

    def __init__(
        self, bus: can.BusABC, source: str, life_ms: float, steps: Sequence[Step], origin_s: float, after_s: float = 0.0
    ) -> None:
        self.let_go, self.presses = False, 0
        self._now, self._origin_s, self._due_s = 0.0, origin_s, after_s
        self._sender = OperatorSender(bus, source, life_ms, clock=lambda: self._now)
        self._steps, self._held = steps, False
        self._ends = list(itertools.accumulate(step.seconds for step in steps))

    def send(self, now: float) -> None:
        self._origin_s = now if math.isnan(self._origin_s) else self._origin_s
        since_s = now - self._origin_s
        if since_s < self._due_s:
            return
        self._now = now
        self._due_s += CYCLE_S
        due = (step for step, end in zip(self._steps, self._ends, strict=True) if since_s < end)
        step = None if self.let_go else next(due, None)
        held = step is not None and step.mode != "release"
        self.presses += held and not self._held
        self._held = held
        self._sender.steer("release" if step is None else step.mode, 0.0 if step is None else step.value)
        self._sender.listen()


def second_operators(bus: can.BusABC, jog: JogTable) -> dict[str, ScriptedOperator]:
    """An operator of the same source as `jog`, and one of another: released for two cycles, then backwards."""
    other = next(name for name in frames()[SETPOINT].field("Source").names.values() if name != jog.source)
    named = {"same": jog.source, "other": other}
    return {
        target: ScriptedOperator(bus, source, jog.life_ms, _SECOND, math.nan, _AFTER_S)
        for target, source in named.items()
    }


class FalseController:
    """A node that sends a controller's frames in the last slot of a tick: its own, or recorded ones."""

    def __init__(self, medium: Medium, frame_map: FrameMap, tick_s: float, kinds: set[str]) -> None:
        asked = kinds & {"second_master", "player"}
        self._port = SimulatedBus(medium, "stranger") if asked else None
        self._frame_map, self._tick_s = frame_map, tick_s
        self._names = ("Sync", "ControllerHeartbeat", frame_map.command)
        self._transmitter = None if self._port is None else FrameTransmitter(self._port, self._names)
        self._recorded: list[can.Message] = []
        self._ticks, self._played, self._since = 0, 0, math.nan

    def send(self, now: float, kinds: set[str]) -> None:
        if self._port is None or self._transmitter is None:
            return
        own = controllers_frames()
        while (message := self._port.recv(0)) is not None:
            if message.arbitration_id in own and "player" not in kinds:
                self._recorded.append(message)
        if "second_master" in kinds:
            self._lead(self._transmitter)
        if "player" in kinds and self._recorded:
            self._play(self._port, now)

    def _lead(self, transmitter: FrameTransmitter) -> None:
        self._ticks += 1
        tick = (
            {"Tick": self._ticks, "Period_s": self._tick_s},
            heartbeat(2, self._ticks * self._tick_s),
            self._frame_map.values(1e-4 * self._ticks, 0.05, ENABLE),
        )
        for name, values in zip(self._names, tick, strict=True):
            transmitter.say(name, values)

    def _play(self, port: SimulatedBus, now: float) -> None:
        """Send what was recorded as long after the recording's begin as `now` is after the begin of the replay."""
        self._since = now if math.isnan(self._since) else self._since
        until = self._recorded[0].timestamp + now - self._since + self._tick_s
        while self._played < len(self._recorded) and self._recorded[self._played].timestamp < until:
            with contextlib.suppress(can.CanError):
                port.send(self._recorded[self._played])
            self._played += 1
