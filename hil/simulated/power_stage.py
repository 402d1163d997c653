"""The power stage of each kind of drive: how it follows its setpoint and reaches its safe state."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from hil.nodes.frame_map import QUICK_STOP_M_S2


@dataclass(kw_only=True)
class Power(ABC):
    """Turns a setpoint into the plant's command. `output` is the drive's own measurement in the command's unit. `stray`
    is the unwanted motion of a broken drive that is disabled: a carriage's speed, a coil's current, a level.
    """

    output: float = 0.0
    overload: bool = False
    stray: float = 0.0

    @abstractmethod
    def aim(self, setpoint: float, over_s: float) -> None:
        """Set a new setpoint, to be reached in `over_s`."""

    @abstractmethod
    def step(self, dt: float, share: float, sensed: float) -> float:
        """The plant's command for the next `dt` s within a `share` of the limits; 0: towards the safe state."""

    @property
    @abstractmethod
    def at_rest(self) -> bool:
        """Whether this is the safe state."""


@dataclass
class CarriagePower(Power):
    """A linear axis, which goes straight to each setpoint within speed and travel. Safe state: at rest, reached by
    braking at `braking_m_s2`. It is not withdrawn: the magnet's pull on a resting capsule is bounded, the effect of a
    carriage that moves by itself is not.
    """

    speed_m_s: float
    travel_m: float
    rate: float = 0.0
    braking_m_s2: float = QUICK_STOP_M_S2
    _target: float = 0.0
    _left_s: float = 0.0

    def aim(self, setpoint: float, over_s: float) -> None:
        self._target, self._left_s = min(max(setpoint, -self.travel_m), self.travel_m), over_s

    def step(self, dt: float, share: float, sensed: float) -> float:
        if share > 0:
            most = share * self.speed_m_s
            rate = (self._target - self.output) / max(self._left_s, dt)
            self.rate = min(max(rate, -most), most)
            self._left_s = max(self._left_s - dt, 0.0)
            self.output += self.rate * dt
        else:
            before, brake = self.rate - self.stray, self.braking_m_s2 * dt
            self.rate = math.copysign(max(abs(before) - brake, 0.0), before) + self.stray
            before += self.stray
            self.output += 0.5 * (before + self.rate) * dt
            self._target, self._left_s = self.output, 0.0
        self.output = min(max(self.output, -self.travel_m), self.travel_m)
        return self.output

    @property
    def at_rest(self) -> bool:
        return self.rate == self.stray


@dataclass
class CoilPower(Power):
    """A current source: `U = R (i* + s) + K (i* - i)` within the supply, where K brings a coil of the rated R and L to
    i* in one step and s is the sum of the remaining errors. Safe state: current driven to zero, then short-circuited;
    the capsule is then kept in place by the wall's friction.
    """

    current_A: float
    resistance_ohm: float
    inductance_H: float
    supply_V: float = 24.0
    voltage_V: float = 0.0
    _begin: float = 0.0
    _target: float = 0.0
    _over_s: float = 0.0
    _left_s: float = 0.0
    _sum: float = 0.0
    _wanted: float = 0.0

    def aim(self, setpoint: float, over_s: float) -> None:
        self._begin, self._target = self.setpoint, setpoint
        self._over_s = self._left_s = over_s

    @property
    def setpoint(self) -> float:
        done = 1 - self._left_s / self._over_s if self._over_s > 0 else 1.0
        return self._begin + done * (self._target - self._begin)

    def step(self, dt: float, share: float, sensed: float) -> float:
        self.output, self.overload = sensed, abs(sensed) > 1.3 * self.current_A
        self._left_s = max(self._left_s - dt, 0.0)
        if share <= 0 and self.setpoint != 0.0:
            self._begin = self._target = self._sum = 0.0
        wanted = min(max(self.setpoint, -share * self.current_A), share * self.current_A)
        wanted = wanted if share > 0 else self.stray
        missing, failed, self._wanted = wanted - sensed, self._wanted - sensed, wanted
        self._sum = min(max(self._sum + failed, -0.2 * self.current_A), 0.2 * self.current_A)
        turns = dt * self.resistance_ohm / self.inductance_H if self.inductance_H > 0 else math.inf
        gain = self.resistance_ohm * math.exp(-turns) / (1 - math.exp(-turns))
        volts = self.resistance_ohm * (wanted + self._sum) + gain * missing
        self.voltage_V = min(max(volts, -self.supply_V), self.supply_V)
        return self.voltage_V

    @property
    def at_rest(self) -> bool:
        return abs(self.output - self.stray) <= 0.01 * self.current_A and self.setpoint == 0.0


@dataclass
class InnerMassPower(Power):
    """A switched coil on board, at a share of its rated force. Safe state: off; the mass swings out."""

    stretch_m: float = 0.0
    _level: float = 0.0

    def aim(self, setpoint: float, over_s: float) -> None:
        self._level = setpoint

    def step(self, dt: float, share: float, sensed: float) -> float:
        self.stretch_m = sensed
        if share <= 0:
            self._level = 0.0
        self.output = min(max(self._level, 0.0), share) if share > 0 else self.stray
        return self.output

    @property
    def at_rest(self) -> bool:
        return self.output == self.stray
