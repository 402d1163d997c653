"""A bus on which a drive of another maker appears as the catalogue's carriage; the controller stays the same."""

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
    """Passes frames between controller and `inner` and translates those of the carriage, as a subclass defines. The
    drive's frames get CRC and counter here, so these protect nothing outside this process. A command of another master
    to the drive is received as a CarriageCommand, which shows that another controller is on the bus.
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
        """What is wrong with the drive in its maker's terms, "" without a fault."""
        return f"{self.table.where} node {self.table.node_id}: {self.wrong}" if self.wrong else ""

    @property
    @abstractmethod
    def wrong(self) -> str:
        """`trouble` without the drive's name."""

    @abstractmethod
    def command(self, mode: int, position_m: float, timeout: float | None) -> None:
        """A command of the controller: `mode`, and the position `position_m` for the next SYNC."""

    @abstractmethod
    def synchronise(self, timeout: float | None) -> None:
        """A tick begins."""

    @abstractmethod
    def acknowledge(self, timeout: float | None) -> None:
        """An acknowledgement of the drive's fault."""

    @abstractmethod
    def halt(self, timeout: float | None) -> None:
        """A SafeStop for the carriage."""

    @abstractmethod
    def take(self, message: can.Message) -> bool:
        """Process a frame of the drive; False for any other frame."""

    def live(self, timeout: float | None) -> None:
        """The controller's heartbeat is due."""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame of the catalogue; those of the carriage are translated. Raises can.CanError as `inner`."""
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
        """The next frame, the drive's translated to the catalogue's; None without one."""
        while not self._ready:
            message = self.inner.recv(timeout)
            if message is None:
                return None
            if self.table.orders(message):
                return self._as_received(message, self._command_id, 8)
            if not self.take(message):
                return message
        return self._ready.popleft()

    def feed(self, state: int, position_m: float, speed_m_s: float, stamp: float) -> None:
        speed = min(max(speed_m_s, -FASTEST_M_S), FASTEST_M_S)
        temperature = {"State": float(state), "Temperature_degC": NOT_MEASURED_C}
        self._hear("CarriageFeedback", {"Position_m": position_m, "Velocity_m_s": speed, **temperature}, stamp)

    def beat(self, state: int, stamp: float, *, anew: bool = False) -> None:
        """Pass a heartbeat to the controller; `anew` if the drive has just booted."""
        self._began_s = stamp if math.isnan(self._began_s) or anew else self._began_s
        self._hear("CarriageHeartbeat", heartbeat(IN_HEARTBEAT[state], stamp - self._began_s), stamp)

    def fail(self, code: int, detail: int, stamp: float) -> None:
        """Pass a fault to the controller, twice as the catalogue asks for."""
        for _ in range(2):
            self._hear("CarriageFault", {"Code": code, "Detail": detail & 0xFFFF}, stamp)

    def refuse(self, name: str, message: can.Message) -> None:
        """Pass a frame that is too short as the catalogue's `name`, which is then refused for its length."""
        self._ready.append(self._as_received(message, self._speakers[name].id, _TOO_SHORT))

    @staticmethod
    def _as_received(message: can.Message, identifier: int, most: int) -> can.Message:
        """A frame of the wire under an identifier of the catalogue; its CRC and counter do not fit."""
        return classic_frame(identifier, message.data[:most], message.timestamp, heard=True)

    def _hear(self, name: str, values: dict[str, float], stamp: float) -> None:
        """Pass a frame to the controller; one with a value out of range is dropped, as a corrupt one would be."""
        with suppress(ValueError):
            self._ready.append(self._speakers[name].message(values, stamp, heard=True))

    def say(self, identifier: int, data: bytes, timeout: float | None) -> None:
        """Send one of the drive's own frames, classic, with an 11-bit identifier."""
        self.inner.send(classic_frame(identifier, data), timeout)


IDLE_TICKS: Final = 5  # commands to remove the torque, after braking
_SETTLE: Final = 2  # ticks at the end of braking


class TurningBus(CarriageBus):
    """The bus of a drive that counts turns, follows positions and coasts without torque. A command is kept until the
    next SYNC. A stop acts at once: the carriage is braked by a sequence of positions.

    `_armed`: commands are passed on, from "ready" on; `_led`: the drive has followed since. `_left` is why that ended.
    `_asked` counts ticks in which it did not follow yet, `_stopped` the commands to stop.
    """

    def __init__(self, inner: can.BusABC, table: TurningTable, tick_s: float) -> None:
        super().__init__(inner, table, tick_s)
        self._position_m = self._speed_m_s = self._wanted_m = 0.0
        self._last_m = self._rate_m_s = math.nan
        self._armed = self._led = self._fresh = False
        self._asked, self._stopped, self._left = 0, 0, ""
        self._braking: tuple[float, float] | None = None
        self._rested = 0

    @property
    @abstractmethod
    def shown(self) -> int:
        """The drive's state in the catalogue's numbers."""

    def command(self, mode: int, position_m: float, timeout: float | None) -> None:
        if mode == ENABLE and self._armed:
            self._wanted_m, self._fresh = position_m, True
        elif mode == READY and self.shown == STANDBY:
            self._arm()
        elif mode not in (READY, ENABLE):
            self._armed = False
        if not self._armed:
            self._rest(timeout)

    def halt(self, timeout: float | None) -> None:
        """Brake with the next command, within a tick."""
        self._armed = False

    def _arm(self) -> None:
        self._armed, self._led, self._asked, self._left = True, False, 0, ""
        self._last_m, self._stopped = math.nan, 0

    @abstractmethod
    def _rest(self, timeout: float | None) -> None:
        """The next step of braking, and finally the command to stop."""

    def _take_wanted(self, begin_m: float) -> None:
        self._rate_m_s, self._last_m = (self._wanted_m - begin_m) / self._tick_s, self._wanted_m
        self._braking, self._rested = None, 0

    def _brake(self) -> tuple[float, float] | None:
        """The next position and rate of braking, from the last command or measured; None after `_SETTLE` ticks."""
        if self._rested >= _SETTLE:
            return None
        moves = (self._position_m, self._speed_m_s) if math.isnan(self._last_m) else (self._last_m, self._rate_m_s)
        position, before = self._braking or moves
        rate = math.copysign(max(abs(before) - QUICK_STOP_M_S2 * self._tick_s, 0.0), before)
        self._braking = position + 0.5 * (before + rate) * self._tick_s, rate
        self._rested += before == 0.0
        return self._braking
