"""Questions to a drive and its answers, before the controller listens."""

import time
from collections.abc import Callable, Iterator

import can

from hil.drives.table import ActuatorTable
from hil.nodes.listening import heard_for, waiting

_SKIPPED = 20_000  # frames that are let go before a question


class Questions:
    """`speaker` says of a frame which node it is from, -1 where it is none of the maker's drives."""

    def __init__(self, bus: can.BusABC, table: ActuatorTable, speaker: Callable[[can.Message], int]) -> None:
        self._bus, self._table, self._speaker, self.node = bus, table, speaker, table.node
        self._errors, self._others = 0, set[int]()

    def send(self, message: can.Message) -> None:
        """Send one frame; what came before is let go. Raises ValueError where the bus does not take it."""
        try:
            for _ in waiting(self._bus, _SKIPPED):
                pass
            self._bus.send(message, timeout=0.1)
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            raise ValueError(f"{self.node} must be reached; got: {error}") from None

    def heard(self, seconds: float) -> Iterator[can.Message]:
        for message in heard_for(self._bus, seconds):
            self._errors += message.is_error_frame
            speaker = self._speaker(message)
            if speaker == self._table.node_id:
                yield message
            elif speaker > 0:
                self._others.add(speaker)

    def answer(self, question: Callable[[], can.Message], fits: Callable[[can.Message], bool]) -> can.Message | None:
        """The frame that answers, asked for again each 0.1 s, for as long as the drive may take to be found."""
        end = time.monotonic() + self._table.answers_s
        while time.monotonic() < end:
            self.send(question())
            if (found := next(filter(fits, self.heard(0.1)), None)) is not None:
                return found
        return None

    def silent(self, of_errors: str, of_silence: str) -> ValueError:
        """That it did not answer, who speaks instead, and what to look at where there were error frames, or silence."""
        speak = f"; node {', '.join(map(str, sorted(self._others)))} speaks" if self._others else ""
        broken = f"; {self._errors} error frames: {of_errors}" if self._errors else ""
        silence = "" if speak or broken else f"; silence: {of_silence}"
        return ValueError(f"{self.node} must answer within {self._table.answers_s:g} s{speak}{broken}{silence}")
