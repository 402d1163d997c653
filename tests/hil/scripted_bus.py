"""A bus that gives what it was filled with."""

import can


class ScriptedBus(can.BusABC):
    """Gives what it was filled with, then nothing; raises what stands among it. `sent` is what was said to nobody."""

    def __init__(self, *waiting: can.Message | Exception | None) -> None:
        super().__init__(channel="scripted")
        self.waiting = list(waiting)
        self.sent: list[can.Message] = []
        self.shutdown()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        found = self.waiting.pop(0) if self.waiting else None
        if isinstance(found, Exception):
            raise found
        return found
