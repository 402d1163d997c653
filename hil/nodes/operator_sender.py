"""An operator as a node on the bus: it sends setpoints and receives the controller's answers."""

import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import can

from hil.bus.codec import Refusal
from hil.bus.protection import FrameTransmitter, Receiver
from hil.bus.wrapping import plain, waiting
from hil.nodes.frame_map import controllers_frames, frames
from hil.nodes.operator import SETPOINT, STATUS
from models.words.quantities import fixed
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)

CYCLE_S: Final = 0.02  # period of setpoints, released ones included
_NOBODY: Final = "nobody"  # `source` of an answer without an operator
_MOST: Final = 256  # frames that are read in one call
_READ_S: Final = 0.02  # An answer covers the setpoints sent at least so long before it


@dataclass(frozen=True, slots=True)
class OperatorAnswer:
    """The controller's last answer; `refused` is the reason of a refusal within the last 0.2 s ("none")."""

    state: str
    source: str
    refused: str
    position_m: float
    speed_m_s: float


def steering_words(answer: OperatorAnswer | None, led: bool, source: str) -> str:
    """The state of steering for the sender `source`, with its cause and remedy; `led`: a controller was heard."""
    if answer is None:
        return TEXT("steering.not_accepted" if led else "steering.no_controller")
    reason, state, free = answer.refused, answer.state, answer.source == _NOBODY
    if reason == "range" and not free:
        state = "end"
    elif reason != "none" and answer.source != source:
        return refusal_words(reason, answer.source)
    elif state == "held" and not free:
        state = "holds"
    return TEXT(f"steering.{state}", source=answer.source, mm=fixed(1e3 * answer.position_m, 2))


def refusal_words(reason: str, source: str) -> str:
    return TEXT(f"refused.{reason}", source="another sender" if source == _NOBODY else source)


class OperatorSender:
    """Sends OperatorSetpoint on `bus` as `source`; each setpoint is valid for `life_ms`, 1 to 200.

    Call one of `speed`, `position`, `release` every `CYCLE_S`, and `listen` as often: the controller accepts a sender
    only after a `release`. The counter rises by one each `CYCLE_S` of `clock`, also after a late call. Of the setpoints
    with the switch pressed, `taken` counts those for which this source was in charge and `refused` the others by
    reason; `others` counts those that another node sends as this source, `led` says that a controller was heard.
    Raises ValueError for an unknown source.
    """

    def __init__(
        self,
        bus: can.BusABC,
        source: str = "script",
        life_ms: float = 100.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        frame, status = frames()[SETPOINT], frames()[STATUS]
        life = frame.field("TimeToLive_ms")
        if not life.lower <= life_ms <= life.upper:
            raise ValueError(f"life_ms must lie in [{life.lower:g}, {life.upper:g}]; got {life_ms:g}")
        self.bus, self.answer, self.answers, self.sent = bus, None, 0, 0
        self.taken, self.others, self.led = 0, 0, False
        self.refused: Counter[str] = Counter()
        self.transmitter = FrameTransmitter(bus, (SETPOINT,))
        self.source = source
        self._pending: list[float] = []
        self._clock, self._said_at, self._behind_s = clock, math.inf, 0.0
        self._common = {"TimeToLive_ms": life_ms, "Source": float(frame.field("Source").number(source))}
        self._modes = {raw: float(frame.field("Mode").number(raw)) for raw in ("position", "speed")}
        self._id, self._receiver, self._controllers = status.id, Receiver(status), controllers_frames()
        setpoint = frame.field("Source")
        self._setpoint, self._shift, self._mask = frame.id, setpoint.start, (1 << setpoint.length) - 1
        self._names = {name: status.field(name).names for name in ("State", "Source", "Refused")}

    answer: OperatorAnswer | None

    def speed(self, speed_m_s: float) -> None:
        """Move at a speed, dead-man switch pressed; the controller keeps it within the deployment's limits."""
        self._say("speed", 0.0, speed_m_s, pressed=True)

    def position(self, position_m: float, speed_m_s: float = 0.0) -> None:
        """Go to a position, no faster than `speed_m_s` (0: the deployment's speed), dead-man switch pressed."""
        self._say("position", position_m, speed_m_s, pressed=True)

    def steer(self, mode: str, value: float) -> None:
        if mode == "release":
            self.release()
        else:
            (self.speed if mode == "speed" else self.position)(value)

    def release(self) -> None:
        """Release the dead-man switch: the capsule stops at once, and the drive after a while."""
        self._say("speed", 0.0, 0.0, pressed=False)

    def listen(self) -> OperatorAnswer | None:
        """Read the bus; an error of the bus is silence. Returns the controller's last answer, None before the first."""
        for message in waiting(self.bus, _MOST):
            if not plain(message):
                continue
            self.led = self.led or message.arbitration_id in self._controllers
            if message.arbitration_id == self._id:
                self._take(message)
            elif message.arbitration_id == self._setpoint:
                named = int.from_bytes(message.data, "little") >> self._shift & self._mask
                self.others += named == self._common["Source"]
        return self.answer

    def _take(self, message: can.Message) -> None:
        values = self._receiver.accept(message.data, message.timestamp)
        if not isinstance(values, Refusal):
            state, source, refused = (self._names[name][int(values[name])] for name in self._names)
            self.answer = OperatorAnswer(state, source, refused, values["Position_m"], values["Velocity_m_s"])
            self.answers += 1
            self._count(self.answer)

    def _count(self, answer: OperatorAnswer) -> None:
        """Count the setpoints that the controller had read when it sent `answer`."""
        read = [sent for sent in self._pending if sent <= self._clock() - _READ_S]
        if answer.source != self.source and answer.refused != "none" and read:
            self.refused[answer.refused] += len(read)
        else:
            self.taken += len(read)
        self._pending = self._pending[len(read) :]

    def _say(self, mode: str, position_m: float, speed_m_s: float, *, pressed: bool) -> None:
        now = self._clock()
        self._behind_s = max(self._behind_s + now - self._said_at - CYCLE_S, 0.0)
        missed, self._said_at = int(self._behind_s / CYCLE_S), now
        self._behind_s -= missed * CYCLE_S
        self.transmitter.skip(SETPOINT, missed)
        values = {"Mode": self._modes[mode], "Position_m": position_m, "Velocity_m_s": speed_m_s}
        self.transmitter.say(SETPOINT, values | self._common | {"DeadMan": float(pressed)})
        self.sent += 1
        if pressed:
            self._pending = [*self._pending[1 - _MOST :], now]
