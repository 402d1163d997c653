"""Reception of the controller node: protected frames, their ages, and the measurements in them."""

import math
from collections import Counter, deque
from collections.abc import Mapping
from typing import Any, Final

import can

from controller.signals import Measurement
from hil.bus.catalogue import Frame
from hil.bus.codec import Reason, Refusal
from hil.bus.protection import Receiver, Reception, crc8
from hil.bus.wrapping import plain, waiting
from hil.nodes.frame_map import BOOT, FrameMap, Observer, controllers_frames, frames
from hil.nodes.guard import Evidence
from hil.nodes.operator import SETPOINT, Operator
from models.files.toml import beside
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
BACK_S: Final = 0.5  # decrease of an uptime that counts: larger than by frames that a link swaps or repeats
BACKS: Final = 3  # decreases that mean two nodes; a node that reboots causes one
WITHIN_S: Final = 0.5  # within which these decreases happen


class Twins:
    """Detects two senders of one heartbeat by their uptimes, if they started `BACK_S` apart; checks the CRC alone."""

    __slots__ = ("_backs", "_data_id", "_length", "_mask", "_shift", "_step_s", "_up_s", "heard_at", "name")

    def __init__(self, heartbeat: Frame) -> None:
        uptime = heartbeat.field("Uptime_s")
        self.name, self._data_id, self._length = heartbeat.name, heartbeat.data_id, heartbeat.length
        self._shift, self._mask, self._step_s = uptime.start, (1 << uptime.length) - 1, uptime.scale
        self._backs: deque[float] = deque(maxlen=BACKS)
        self._up_s, self.heard_at = 0.0, -math.inf

    def hear(self, data: bytes | bytearray, stamp: float) -> None:
        if len(data) != self._length or crc8(memoryview(data)[1:], self._data_id) != data[0]:
            return
        up_s = (int.from_bytes(data, "little") >> self._shift & self._mask) * self._step_s
        if up_s < self._up_s - BACK_S:
            self._backs.append(stamp)
        self._up_s, self.heard_at = up_s, stamp

    def two(self, now: float) -> bool:
        return len(self._backs) == BACKS and now - self._backs[0] <= WITHIN_S


MOST: Final = 256  # frames of a tick
SKIPPED: Final = 20_000  # frames that are discarded before the node begins
HEARTBEAT_LOST_S: Final = 0.06  # three periods
LOCALISER: Final = "LocaliserHeartbeat"
SAFE_STOP: Final = "safe stop by an operator"
BY_OPERATOR: Final = 0  # `Reason` of an operator's SafeStop


REASONS: Final[dict[str, list[str]]] = beside(__file__, "remedies.toml")
"""By the key of its sentence, what a reason has in it; the first that fits counts."""


def remedy(ended: str) -> str:
    fits = (key for key, parts in REASONS.items() if any(part in ended for part in parts))
    key = next(fits, "")
    return TEXT(f"remedy.{key}") if key else ""


def refusal_cause(reason: str) -> str:
    return TEXT(f"frame.{reason}")


def operators_stop(message: can.Message) -> bool:
    """Whether a frame is a SafeStop that an operator sends; its counter does not count, as it only stops."""
    frame = frames()["SafeStop"]
    values = Receiver(frame).accept(message.data, 0.0) if message.arbitration_id == frame.id else Refusal("unknown")
    return not isinstance(values, Refusal) and values["Reason"] == BY_OPERATOR


class FrameReceiver:
    """Reads a bus: `listen` empties it (at most 256 frames per tick) and returns the measurements of good frames.

    `state`, `report` (position in m, current in A, level) and `temperature_C` are the drive's last good feedback,
    `fault` the code that it has latched, `challenge` its unanswered number (-1: none), `still` the signal that is
    constant while the drive is disabled. The last `listen` found `frames` good frames, of which `feedbacks` were the
    drive's; `full` counts ticks that reached the 256 frames; `age_s` is the age of the newest localisation when read.

    `foreign` counts frames that only a controller sends, by name; `stopped_at` is the time of an operator's safe stop,
    which is none of them. `strange` counts frames other than classic data frames with an 11-bit identifier, by type;
    `deaf` counts ticks in which the bus raised.
    """

    def __init__(
        self,
        bus: can.BusABC,
        frame_map: FrameMap,
        tick_s: float,
        observer: Observer | None = None,
        operator: Operator | None = None,
    ) -> None:
        sensors = ("CapsuleLocalisation", LOCALISER, "ForceReading", "ForceSensorHeartbeat")
        names = (frame_map.feedback, frame_map.fault, frame_map.heartbeat, frame_map.challenge, *sensors)
        self.reception = Reception(frames()[name] for name in names)
        self._twins = {frames()[name].id: Twins(frames()[name]) for name in (frame_map.heartbeat, LOCALISER)}
        self._beats = tuple(self._twins.values())
        self.frame_map, self.tick_s = frame_map, tick_s
        self.state, self.report, self.temperature_C, self.fault = BOOT, 0.0, 20.0, 0
        self.still = 0.0
        self.challenge, self.feedbacks, self.frames, self.full = -1, 0, 0, 0
        self.age_s = math.inf
        self.deaf, self.deaf_words = 0, ""
        self.strange: Counter[str] = Counter()
        self.foreign: Counter[str] = Counter()
        self.foreign_at = self.stopped_at = -math.inf
        self._foreign = controllers_frames()
        self._fingerprint, self._other = frames().fingerprint, False
        self._bus, self._observer, self.operator = bus, observer, operator
        self._place_at = self._fed_at = -math.inf
        self._beat_at = math.nan

    @property
    def rejected(self) -> int:
        operator = 0 if self.operator is None else self.operator.refused.total()
        return self.reception.refused + operator + self.reception.unknown.total() + self.foreign.total()

    @property
    def errors(self) -> int:
        return self.strange["error"]

    def skip(self) -> None:
        """Discard the waiting frames: a queue that overflowed has a gap. Never raises, takes bounded time."""
        for _ in waiting(self._bus, SKIPPED):
            pass

    def listen(self, now: float) -> list[Measurement]:
        """The received measurements. Never raises; a bus that cannot be read counts as silent."""
        found: list[Measurement] = []
        self.feedbacks = self.frames = 0
        for number, message in enumerate(waiting(self._bus, MOST, self._deafened), 1):
            self.full += number == MOST
            if self._observer is not None:
                self._observer(message)
            if not plain(message):
                other = "FD" if message.is_fd else "remote" if message.is_remote_frame else "extended"
                self.strange["error" if message.is_error_frame else other] += 1
                continue
            if message.arbitration_id in self._foreign:
                if operators_stop(message):
                    self.stopped_at = now
                else:
                    self.foreign[self._foreign[message.arbitration_id]] += 1
                    self.foreign_at = now
                continue
            if self.operator is not None and message.arbitration_id == self.operator.id:
                self.operator.accept(message.data, message.timestamp, now)
                continue
            if message.arbitration_id in self._twins:
                self._twins[message.arbitration_id].hear(message.data, message.timestamp)
            values = self.reception.accept(message.arbitration_id, message.data, message.timestamp)
            if not isinstance(values, Refusal):
                self.frames += 1
                name = self.reception.receivers[message.arbitration_id].frame.name
                self._take(name, values, message.timestamp, now, found)
        return found

    def _deafened(self, error: Exception) -> None:
        self.deaf += 1
        self.deaf_words = f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"

    @property
    def beating(self) -> bool:
        """Whether a heartbeat of the drive has been received: it states the drive's frame catalogue."""
        return not math.isnan(self._beat_at)

    @property
    def error_words(self) -> str:
        return f", {self.errors} error frames: bit rate, wiring, termination" if self.errors else ""

    @property
    def other_controller(self) -> str:
        return f"another controller is on the bus ({', '.join(sorted(self.foreign))})" if self.foreign else ""

    @property
    def refused(self) -> dict[str, dict[str, int]]:
        found: dict[str, Counter[Any]] = {r.frame.name: r.refused for r in self.reception.receivers.values()}
        if self.operator is not None:
            found[SETPOINT] = self.operator.refused
        return {name: {str(why): n for why, n in whys.items()} for name, whys in found.items() if whys}

    @property
    def refused_words(self) -> str:
        words = [f"{sum(whys.values())} {name} refused ({_listed(whys)})" for name, whys in self.refused.items()]
        words += [f"{self.strange.total()} frames of other types ({_listed(self.strange)})"] if self.strange else []
        words += [f"{self.deaf} times the bus could not be read ({self.deaf_words})"] if self.deaf else []
        causes = sum((r.refused for r in self.reception.receivers.values()), Counter[Reason]())
        return ", ".join(words) + "".join(f": {refusal_cause(reason)}" for reason, _ in causes.most_common(1))

    def evidence(self, now: float) -> Evidence:
        return Evidence(now - self._place_at, now - self._fed_at, self.state)

    def doubt(self, now: float) -> str:
        if twins := self.twins(now):
            return twins
        if self._other:
            return "drive knows another DBC"
        if self.fault:
            names = frames()[self.frame_map.fault].field("Code").names
            return f"drive fault {self.fault} ({names[self.fault].replace('_', ' ')})"
        if now - self._beat_at > HEARTBEAT_LOST_S:
            refused = now - self._beats[0].heard_at <= HEARTBEAT_LOST_S
            return "drive heartbeat refused: its counters are not one node's" if refused else "drive heartbeat lost"
        return ""

    def twins(self, now: float) -> str:
        """That two drives, or two localisers, send with the same identifiers, "" without any."""
        for one, what in zip(self._beats, ("two drives of the same kind", "two localisers"), strict=True):
            if one.two(now):
                return f"{what} are on the bus ({one.name} has the uptimes of two)"
        return ""

    def _take(self, name: str, values: dict[str, Any], stamp: float, now: float, found: list[Measurement]) -> None:
        if name == "CapsuleLocalisation":
            if values["Valid"]:
                self._place_at = stamp - values["Age_s"]
                self.age_s = now - self._place_at
                found.append(Measurement("position_m", values["Position_m"], self._place_at))
        elif name == self.frame_map.feedback:
            self.feedbacks += 1
            self._fed_at, self.state, self.temperature_C = stamp, int(values["State"]), values["Temperature_degC"]
            self.still = values[self.frame_map.still]
            if not self.frame_map.drive.shaken:
                self.report = values[self.frame_map.signal]
                since = max(now - stamp, 0.0)
                begin = now - self.tick_s * math.ceil(since / self.tick_s - 1e-6)
                found.append(Measurement(self.frame_map.channel, self.report, begin))
        elif name == self.frame_map.fault:
            self.fault = int(values["Code"])
        elif name == self.frame_map.challenge:
            self.challenge = int(values["Number"])
        elif name == self.frame_map.heartbeat:
            self._beat_at = stamp
            self._other = values["Catalogue"] != self._fingerprint


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{reason} {count}" for reason, count in sorted(counts.items()))
