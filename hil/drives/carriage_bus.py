"""A bus on which a drive of another maker speaks as the catalogue's carriage: all behind it stays as it is."""

import math
from abc import abstractmethod
from collections import deque
from contextlib import suppress
from typing import Any, ClassVar, Final

import can

from hil.bus.codec import NOT_MEASURED_C, Codec
from hil.bus.protection import Sender
from hil.bus.wrapping import WrappingBus, classic_frame
from hil.drives.table import ActuatorTable, TurningTable
from hil.nodes.frame_map import ENABLE, FASTEST_M_S, IN_HEARTBEAT, QUICK_STOP_M_S2, READY, STANDBY, frames, heartbeat

_SPOKEN: Final = ("CarriageFeedback", "CarriageHeartbeat", "CarriageFault")
_HEARD: Final = ("CarriageCommand", "ControllerHeartbeat", "DriveReset", "SafeStop", "Sync")
_TOO_SHORT: Final = 7  # bytes: a frame that every node refuses


class CarriageBus(WrappingBus):
    """Passes `inner` on, but for the carriage's frames: a subclass says what the controller's become on the wire, and
    what of the catalogue the drive's own become. These are protected anew, so CRC and counter guard nothing beyond this
    process. What another master commands the drive comes in as a CarriageCommand, which only a controller sends.
    """

    maker: ClassVar[str]
    table: Any

    def __init__(self, inner: can.BusABC, table: ActuatorTable, tick_s: float) -> None:
        super().__init__(inner, f"{self.maker} node {table.node_id} on {inner.channel_info}")
        self.table, self._tick_s, self._command_id = table, tick_s, frames()["CarriageCommand"].id
        self._heard = {frames()[heard].id: (heard, Codec(frames()[heard])) for heard in _HEARD}
        self._speakers = {spoken: Sender(frames()[spoken]) for spoken in _SPOKEN}
        self._ready: deque[can.Message] = deque()
        self._began_s = math.nan

    @property
    def trouble(self) -> str:
        """What is wrong with the drive in its maker's words, "" where nothing is."""
        return f"{self.table.where} node {self.table.node_id}: {self.wrong}" if self.wrong else ""

    @property
    @abstractmethod
    def wrong(self) -> str:
        """The same without its name."""

    @abstractmethod
    def command(self, mode: int, place_m: float, timeout: float | None) -> None:
        """The controller wants the drive in `mode` and the carriage at `place_m` from the next SYNC on."""

    @abstractmethod
    def synchronise(self, timeout: float | None) -> None:
        """A tick begins."""

    @abstractmethod
    def acknowledge(self, timeout: float | None) -> None:
        """The operator acknowledges the drive's fault."""

    @abstractmethod
    def halt(self, timeout: float | None) -> None:
        """A SafeStop for the carriage."""

    @abstractmethod
    def take(self, message: can.Message) -> bool:
        """Take a frame in where it is the drive's; whether it was."""

    def live(self, timeout: float | None) -> None:
        """The controller's heartbeat is due."""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame of the catalogue, the carriage's as the drive's own. Raises can.CanError as `inner`."""
        name, codec = self._heard.get(msg.arbitration_id, ("", None))
        values = codec.decode(int.from_bytes(msg.data, "little")) if codec is not None else None
        if not isinstance(values, dict):
            self.inner.send(msg, timeout)
        elif name == "CarriageCommand":
            self.command(int(values["Mode"]), values["Position_m"], timeout)
        elif name == "ControllerHeartbeat":
            self.live(timeout)
        elif name == "DriveReset":
            if values["Target"] in (0, 1):
                self.acknowledge(timeout)
        else:
            if name == "SafeStop" and values["Target"] in (0, 1):
                self.halt(timeout)
            self.inner.send(msg, timeout)
            if name == "Sync":
                self.synchronise(timeout)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame, the drive's own as the catalogue has it; None where there is none."""
        while not self._ready:
            message = self.inner.recv(timeout)
            if message is None:
                return None
            if self.table.orders(message):
                return self._as_received(message, self._command_id, 8)
            if not self.take(message):
                return message
        return self._ready.popleft()

    def feed(self, state: int, place_m: float, speed_m_s: float, stamp: float) -> None:
        """Let the controller hear a feedback, `state` in the catalogue's numbers."""
        speed = min(max(speed_m_s, -FASTEST_M_S), FASTEST_M_S)
        temperature = {"State": float(state), "Temperature_degC": NOT_MEASURED_C}
        self._hear("CarriageFeedback", {"Position_m": place_m, "Velocity_m_s": speed, **temperature}, stamp)

    def beat(self, state: int, stamp: float, *, anew: bool = False) -> None:
        """Let it hear a heartbeat; `anew` where the drive has just booted."""
        self._began_s = stamp if math.isnan(self._began_s) or anew else self._began_s
        self._hear("CarriageHeartbeat", heartbeat(IN_HEARTBEAT[state], stamp - self._began_s), stamp)

    def fail(self, code: int, detail: int, stamp: float) -> None:
        """Let it hear a fault, twice as every drive tells one."""
        for _ in range(2):
            self._hear("CarriageFault", {"Code": code, "Detail": detail & 0xFFFF}, stamp)

    def refuse(self, name: str, message: can.Message) -> None:
        """Let it hear a frame that is too short: it is refused for its length, as the catalogue's `name`."""
        self._ready.append(self._as_received(message, self._speakers[name].id, _TOO_SHORT))

    @staticmethod
    def _as_received(message: can.Message, identifier: int, most: int) -> can.Message:
        """A frame of the wire as one of the catalogue with the same first bytes; it fits neither CRC nor counter."""
        return classic_frame(identifier, message.data[:most], message.timestamp, heard=True)

    def _hear(self, name: str, values: dict[str, float], stamp: float) -> None:
        """Put a frame before the controller; one that does not fit its range is left out, as a corrupt one would be."""
        with suppress(ValueError):
            self._ready.append(self._speakers[name].message(values, stamp, heard=True))

    def say(self, identifier: int, data: bytes, timeout: float | None) -> None:
        """Send one of the drive's own frames, classic, with an 11-bit identifier."""
        self.inner.send(classic_frame(identifier, data), timeout)


IDLE_TICKS: Final = 5  # how often a drive that has been braked is told to take its torque away
_SETTLE: Final = 2  # steps that a drive has to come to rest


class TurningBus(CarriageBus):
    """A command is held until the next SYNC; what stops the drive acts at once: the carriage is braked by places.

    It is armed from "ready" on, and was led once it has followed since. `_left` says why it was not led on, `_asked`
    counts the ticks in which it did not begin to follow, `_stopped` how often it was stopped.
    """

    def __init__(self, inner: can.BusABC, table: TurningTable, tick_s: float) -> None:
        super().__init__(inner, table, tick_s)
        self._place_m = self._speed_m_s = self._wanted_m = 0.0
        self._last_m = self._rate_m_s = math.nan
        self._armed = self._led = self._fresh = False
        self._asked, self._stopped, self._left = 0, 0, ""
        self._braking: tuple[float, float] | None = None
        self._rested = 0

    @property
    @abstractmethod
    def shown(self) -> int:
        """The drive's state in the catalogue's numbers."""

    def command(self, mode: int, place_m: float, timeout: float | None) -> None:
        """Held until the next SYNC; what stops the drive acts at once."""
        if mode == ENABLE and self._armed:
            self._wanted_m, self._fresh = place_m, True
        elif mode == READY and self.shown == STANDBY:
            self._arm()
        elif mode not in (READY, ENABLE):
            self._armed = False
        if not self._armed:
            self._rest(timeout)

    def halt(self, timeout: float | None) -> None:
        """Brake, with the next command: there is one a tick."""
        self._armed = False

    def _arm(self) -> None:
        self._armed, self._led, self._asked, self._left = True, False, 0, ""
        self._last_m, self._stopped = math.nan, 0

    @abstractmethod
    def _rest(self, timeout: float | None) -> None:
        """A step of the way to rest, and at rest to a drive that is stopped."""

    def _take_wanted(self, begin_m: float) -> None:
        """Go from `begin_m` to the wanted place within the tick."""
        self._rate_m_s, self._last_m = (self._wanted_m - begin_m) / self._tick_s, self._wanted_m
        self._braking, self._rested = None, 0

    def _brake(self) -> tuple[float, float] | None:
        """The next place and rate on the way to rest at `QUICK_STOP_M_S2`, from the last command on, else from where
        the drive is; None once it has had `_SETTLE` ticks to rest there.
        """
        if self._rested >= _SETTLE:
            return None
        moves = (self._place_m, self._speed_m_s) if math.isnan(self._last_m) else (self._last_m, self._rate_m_s)
        place, before = self._braking or moves
        rate = math.copysign(max(abs(before) - QUICK_STOP_M_S2 * self._tick_s, 0.0), before)
        self._braking = place + 0.5 * (before + rate) * self._tick_s, rate
        self._rested += before == 0.0
        return self._braking
