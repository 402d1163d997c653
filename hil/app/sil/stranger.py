"""A node that speaks as a controller beside the true one, in simulated time."""

from __future__ import annotations

import contextlib
import math

import can

from hil.bus.protection import Sender
from hil.bus.simulated import Medium, SimulatedBus
from hil.nodes.controller.receive import controllers_frames
from hil.nodes.frame_map import ENABLE, FrameMap, frames


class Stranger:
    """A node that speaks as a controller where a scenario's faults ask for it: one of its own will, or a player of what
    the true one has said. Its ticks are not those of the true one: it speaks in the last slot of each.
    """

    def __init__(self, medium: Medium, wiring: FrameMap, tick_s: float, kinds: set[str]) -> None:
        asked = kinds & {"second_master", "player"}
        self._port = SimulatedBus(medium, "stranger") if asked else None
        self._wiring, self._tick_s = wiring, tick_s
        self._names = ("Sync", "ControllerHeartbeat", wiring.command)
        self._senders = {name: Sender(frames()[name]) for name in self._names}
        self._said: list[can.Message] = []
        self._ticks, self._played, self._since = 0, 0, math.nan

    def speak(self, now: float, kinds: set[str]) -> None:
        """Its part of a tick, at `now`."""
        if self._port is None:
            return
        own = controllers_frames(frames())
        while (message := self._port.recv(0)) is not None:
            if message.arbitration_id in own and "player" not in kinds:
                self._said.append(message)
        if "second_master" in kinds:
            self._lead(self._port)
        if "player" in kinds and self._said:
            self._play(self._port, now)

    def _lead(self, port: SimulatedBus) -> None:
        """A tick of a controller that has begun on its own and wants the drive to move."""
        self._ticks += 1
        told = (
            {"Tick": self._ticks, "Period_s": self._tick_s},
            {"State": 2, "Uptime_s": self._ticks * self._tick_s, "Catalogue": frames().fingerprint},
            self._wiring.values(1e-4 * self._ticks, 0.05, ENABLE),
        )
        for name, values in zip(self._names, told, strict=True):
            data = self._senders[name].frame(values)
            self._send(port, can.Message(arbitration_id=frames()[name].id, is_extended_id=False, data=data))

    def _play(self, port: SimulatedBus, now: float) -> None:
        """What was said in the tick that is as long after the recording's begin as `now` is after the player's."""
        self._since = now if math.isnan(self._since) else self._since
        until = self._said[0].timestamp + now - self._since + self._tick_s
        while self._played < len(self._said) and self._said[self._played].timestamp < until:
            self._send(port, self._said[self._played])
            self._played += 1

    def _send(self, port: SimulatedBus, message: can.Message) -> None:
        with contextlib.suppress(can.CanError):
            port.send(message)
