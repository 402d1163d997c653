"""Senders beside the controller in simulated time: the operator of `[jog]`, a second operator, a false controller."""

import contextlib
import itertools
import math
from typing import Final

import can

from hil.app.scenario.bus_scenario import JogTable
from hil.bus.catalogue import FrameCatalogue
from hil.bus.protection import FrameTransmitter
from hil.nodes.frame_map import ENABLE, FrameMap, controllers_frames, heartbeat
from hil.nodes.operator import SETPOINT
from hil.nodes.operator_sender import CYCLE_S, OperatorSender
from hil.simulated.medium import Medium, SimulatedBus

_AFTER_S: Final = 7e-3  # by which the second operator begins after its fault
_RELEASED_S: Final = 2 * CYCLE_S  # for which it sends a release first
_BACK_M_S: Final = -0.4  # speed that it asks for


class ScriptedOperator:
    """Sends one setpoint of `jog` in each cycle; `presses` counts presses; after `let_go` it stays released."""

    def __init__(self, bus: can.BusABC, jog: JogTable) -> None:
        self.let_go, self.presses = False, 0
        self._now = 0.0
        self._sender = OperatorSender(bus, jog.source, jog.life_ms, clock=lambda: self._now)
        self._steps = jog.planned()
        self._ends = list(itertools.accumulate(step.seconds for step in self._steps))
        self._due_s, self._held = 0.0, False

    def send(self, now: float) -> None:
        """Send the setpoint that is due until `now` in s."""
        if now < self._due_s:
            return
        self._now = now
        self._due_s += CYCLE_S
        due = (step for step, end in zip(self._steps, self._ends, strict=True) if now < end)
        step = None if self.let_go else next(due, None)
        held = step is not None and step.mode != "release"
        self.presses += held and not self._held
        self._held = held
        self._sender.steer("release" if step is None else step.mode, 0.0 if step is None else step.value)
        self._sender.listen()


class SecondOperator:
    """A second operator: released for two cycles, then as fast backwards as the frame allows."""

    def __init__(self, bus: can.BusABC, jog: JogTable, catalogue: FrameCatalogue) -> None:
        names = catalogue[SETPOINT].field("Source").names.values()
        other = next(name for name in names if name != jog.source)
        self._now = 0.0
        self._senders = {
            target: OperatorSender(bus, source, jog.life_ms, clock=lambda: self._now)
            for target, source in (("same", jog.source), ("other", other))
        }
        self._began_s, self._due_s = math.nan, -math.inf
        self.presses = 0

    def send(self, now: float, target: str) -> None:
        """Send the setpoint that is due until `now` in s; `target` is "same" or "other"."""
        if math.isnan(self._began_s):
            self._began_s, self._due_s = now, now + _AFTER_S
        if now < self._due_s:
            return
        self._now = now
        self._due_s += CYCLE_S
        sender = self._senders[target]
        if now - self._began_s < _AFTER_S + _RELEASED_S:
            sender.release()
        else:
            self.presses += target == "same" and not self.presses
            sender.speed(_BACK_M_S)
        sender.listen()


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
        """Send its frames of a tick, at `now`."""
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
        """The frames of a second controller that wants the drive to move."""
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
