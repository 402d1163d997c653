"""What a node says: its own frames, protected; a bus that does not take them is counted, never raised."""

from collections.abc import Iterable, Mapping

import can

from hil.bus.catalogue import Catalogue
from hil.bus.protection import Sender


class FrameTransmitter:
    """Senders of the frames `names` on a bus. `unsent` counts what did not go out."""

    def __init__(self, bus: can.BusABC, catalogue: Catalogue, names: Iterable[str]) -> None:
        self._bus, self._senders = bus, {name: (catalogue[name].id, Sender(catalogue[name])) for name in names}
        self.unsent = 0

    def say(self, name: str, values: Mapping[str, float]) -> None:
        identifier, sender = self._senders[name]
        try:
            message = can.Message(
                arbitration_id=identifier, is_extended_id=False, data=sender.frame(values), is_rx=False
            )
            self._bus.send(message, timeout=0)
        except Exception:  # noqa: BLE001 - drivers of many makers raise whatever they like
            self.unsent += 1

    def skip(self, name: str, frames: int) -> None:
        """Count `frames` that there was no time to send."""
        self._senders[name][1].skip(frames)
