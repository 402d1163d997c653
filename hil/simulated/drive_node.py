"""The catalogue's drive on the bus, simulated: reception, state machine, temperature, reports."""

import math
import secrets
from collections.abc import Callable
from typing import Final

import can

from controller.limits import Limits
from hil.bus.codec import NOT_MEASURED_C, Refusal
from hil.bus.protection import FrameTransmitter, Reception
from hil.bus.wrapping import plain, waiting
from hil.nodes import frame_map as wire
from hil.nodes.frame_map import FrameMap, answer_of, heartbeat
from hil.simulated import state_machine as states
from hil.simulated.makers_drive import AMBIENT_C, MOST
from hil.simulated.power_stage import CarriagePower, CoilPower, InnerMassPower, Power
from hil.simulated.state_machine import DriveFacts, Stage, SyncClock

HEARTBEAT_S: Final = 0.06  # without the controller's heartbeat, after which a drive stops
SAFE_STOP_S: Final = 0.06  # for which a SafeStop is in force
HOT_S: Final = 0.2  # above the temperature limit, after which a drive fails
_WARMING_S: Final = 60.0  # time constant of the simulated drive's temperature
_WARMTH_C: Final = 8.0  # temperature rise at full load


class DriveNode:
    """Receives frames, steps its state machine, and moves its power stage only while enabled with a valid command.

    A command is valid for its time to live, counted from its arrival, but at most from one tick after the begin of its
    own tick; one that arrives too late is refused (`stale`). It is applied with the next SYNC, or in the drive's own
    cycle without SYNC. A temperature above `derate_C` halves the limits; above `temperature_C` for `HOT_S` it is a
    fault. Further faults are a controller without heartbeat for 60 ms, and the drive's bus-off. A restarted controller
    gets the report of a latched fault again.

    In standby it draws a number (`draw`), sends it, and becomes ready only after the right answer, so a recording
    cannot enable it. `strange` counts frames of other types, `deaf` slots in which the bus raises.
    """

    def __init__(
        self,
        bus: can.BusABC,
        frame_map: FrameMap,
        power: Power,
        limits: Limits,
        tick_s: float,
        draw: Callable[[], int] = lambda: secrets.randbits(32),
    ) -> None:
        self._draw = draw
        self.bus, self.frame_map, self.power, self.limits, self.tick_s = bus, frame_map, power, limits, tick_s
        self.temperature_C = AMBIENT_C
        self.heated_to_C = -math.inf
        self.misread: Callable[[float], float] | None = None
        self.broken, self.node_id = False, frame_map.target
        self.boot(0.0)

    def boot(self, now: float) -> None:
        """Restart, as after a loss of supply: nothing is remembered, counters start at 0."""
        names = (self.frame_map.command, "Sync", "SafeStop", "DriveReset", "EnableAnswer", "ControllerHeartbeat")
        self.reception = Reception(wire.frames()[name] for name in names)
        for name in (self.frame_map.command, "Sync"):
            receiver = self.reception.receivers[wire.frames()[name].id]
            receiver.longest_s = max(receiver.longest_s, 1e-3 * self.frame_map.still_ms)
        ours = self.frame_map
        self.transmitter = FrameTransmitter(self.bus, (ours.feedback, ours.fault, ours.heartbeat, ours.challenge))
        self.stage = Stage(wire.BOOT, now)
        self.good_at, self.stale, self.strange, self.deaf = -math.inf, 0, 0, 0
        self._number, self._answered, self._asked_at = 0, False, -math.inf
        self._clock = SyncClock()
        self._began = now
        self._mode, self._setpoint, self._taken, self._waiting = wire.OFF, 0.0, wire.OFF, False
        self._dies_at = self._stop_until = self._heard_at = self._beat_at = -math.inf
        self._reset, self._hot_since, self._phase, self._reports = wire.NO_FAULT, math.inf, 0, 0
        self._stranger, self._uptime_s, self._shown = False, math.inf, 0.0

    @property
    def rejected(self) -> int:
        return self.stale + self.strange + self.reception.refused

    @property
    def safe(self) -> bool:
        """Whether the drive is in its safe state and follows no command."""
        return self.stage.state not in wire.MOVING and self.power.at_rest

    def listen(self, now: float, slots: int) -> None:
        """One run of the firmware, `slots` of which make a tick: receive, step the state machine, report."""
        synced = self._hear(now)
        self._phase = 0 if synced else (self._phase + 1) % slots
        if self._phase == 0 and not synced:
            self._take_over()
        cause = self._cause(now)
        alive, stopped = now <= self._dies_at, now < self._stop_until
        hot = self.temperature_C > self.limits.derate_C
        facts = DriveFacts(self._mode, alive, stopped, self._reset, cause, hot, self.power.at_rest, self._answered)
        before, self.stage, self._reset = self.stage, states.next_stage(self.stage, facts, now), wire.NO_FAULT
        if self.stage.fault and not before.fault:
            self._reports = 2
        if self.stage.state == wire.STANDBY != before.state:
            self._number, self._answered, self._asked_at = self._draw() & 0xFFFFFFFF, False, -math.inf
        self._report(now, self._phase == 0)

    def output(self, dt: float, sensed: float) -> float:
        share = 0.0 if self.stage.state not in wire.MOVING else 0.5 if self.stage.state == wire.DERATED else 1.0
        load = (self.power.output / self.limits.current_A) ** 2 if isinstance(self.power, CoilPower) else 0.0
        self.temperature_C += dt / _WARMING_S * (AMBIENT_C + _WARMTH_C * load - self.temperature_C)
        self.temperature_C = max(self.temperature_C, self.heated_to_C)
        return self.power.step(dt, share, sensed)

    def _deafened(self, _: Exception) -> None:
        self.deaf += 1

    def _hear(self, now: float) -> bool:
        synced = False
        for message in waiting(self.bus, MOST, self._deafened):
            if not plain(message):
                self.strange += 1
                continue
            values = self.reception.accept(message.arbitration_id, message.data, message.timestamp)
            if isinstance(values, Refusal):
                continue
            receiver = self.reception.receivers[message.arbitration_id]
            name, counter, stamp = receiver.frame.name, receiver.counter, message.timestamp
            if name == "Sync":
                if not self._clock.sync(counter, int(values["Tick"]), values["Period_s"], stamp):
                    self.stale += 1
                    continue
                self._take_over()
                synced = True
            elif name == self.frame_map.command:
                self._follow(values, stamp, self._clock.begin(counter, stamp))
            else:
                self._obey(name, values, stamp)
        return synced

    def _follow(self, values: dict[str, float], stamp: float, begin: float) -> None:
        dies_at = min(stamp, begin + self.tick_s) + 1e-3 * values["TimeToLive_ms"]
        if dies_at <= stamp:
            self.stale += 1
            return
        self._mode, self._setpoint, self._waiting = int(values["Mode"]), values[self.frame_map.signal], True
        self._dies_at, self.good_at = dies_at, stamp

    def _obey(self, name: str, values: dict[str, float], stamp: float) -> None:
        mine = values.get("Target", 0) in (0, self.frame_map.target)
        if name == "SafeStop" and mine:
            self._stop_until = stamp + SAFE_STOP_S
        elif name == "DriveReset" and mine:
            self._reset, self._clock = int(values["Code"]), SyncClock()
        elif name == "EnableAnswer":
            if values["Target"] == self.frame_map.target and self.stage.state == wire.STANDBY:
                self._answered = values["Answer"] == answer_of(self._number, self.frame_map.target)
        elif name == "ControllerHeartbeat":
            if values["Uptime_s"] < self._uptime_s and self.stage.fault:
                self._reports = 2
            self._uptime_s = values["Uptime_s"]
            self._heard_at, self._stranger = stamp, values["Catalogue"] != wire.frames().fingerprint

    def _take_over(self) -> None:
        if self._waiting:
            self._waiting = False
            self.power.aim(self._setpoint, self.tick_s)

    def _cause(self, now: float) -> int:
        if self.bus.state == can.BusState.ERROR:
            return wire.BUS_OFF
        self._hot_since = min(self._hot_since, now) if self.temperature_C > self.limits.temperature_C else math.inf
        if now - self._hot_since >= HOT_S:
            return wire.OVER_TEMPERATURE
        if self.power.overload:
            return wire.OVER_CURRENT
        moving = self.stage.state in (wire.WAITING, *wire.MOVING)
        if moving and (self._stranger or now - self._heard_at > HEARTBEAT_S):
            return wire.HEARTBEAT_LOST
        return wire.NO_FAULT

    def _report(self, now: float, due: bool) -> None:
        if self._reports:
            self._reports -= 1
            self.transmitter.say(self.frame_map.fault, {"Code": self.stage.fault, "Detail": 0})
        if self.stage.state == wire.STANDBY and not self._answered and now - self._asked_at >= 0.02 - 0.1 * self.tick_s:
            self._asked_at = now
            self.transmitter.say(self.frame_map.challenge, {"Number": self._number})
        if due and self.stage.state != wire.BOOT:
            self.transmitter.say(self.frame_map.feedback, self._feedback())
        if now - self._beat_at >= 0.02 - 0.1 * self.tick_s and self.stage.state != wire.BOOT:
            self._beat_at = now
            beat = heartbeat(wire.IN_HEARTBEAT[self.stage.state], now - self._began)
            self.transmitter.say(self.frame_map.heartbeat, beat)

    def _feedback(self) -> dict[str, float]:
        warm = min(max(self.temperature_C, NOT_MEASURED_C + 1), 150.0)
        power, common = self.power, {"State": float(self.stage.state), "Temperature_degC": warm}
        shown = power.output if self.misread is None else self.misread(power.output)
        if isinstance(power, CarriagePower):
            rate = power.rate if self.misread is None else (shown - self._shown) / self.tick_s
            self._shown = shown = min(max(shown, -1.1), 1.1)
            return {"Position_m": shown, "Velocity_m_s": min(max(rate, -0.4), 0.4), **common}
        if isinstance(power, CoilPower):
            return {"Current_A": min(max(shown, -2.6), 2.6), "Voltage_V": power.voltage_V, **common}
        assert isinstance(power, InnerMassPower)
        return {"Stretch_m": min(max(power.stretch_m, -0.016), 0.016), "Current_A": shown, **common}
