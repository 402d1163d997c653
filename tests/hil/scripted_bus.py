"""A bus that gives what it was filled with."""

from __future__ import annotations

import can


class ScriptedBus(can.BusABC):
    """Gives what it was filled with, then nothing; raises what stands among it."""

    def __init__(self, *waiting: can.Message | Exception | None) -> None:
        super().__init__(channel="scripted")
        self.waiting = list(waiting)
        self.shutdown()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Nobody hears it."""

    def recv(self, timeout: float | None = None) -> can.Message | None:
        found = self.waiting.pop(0) if self.waiting else None
        if isinstance(found, Exception):
            raise found
        return found
