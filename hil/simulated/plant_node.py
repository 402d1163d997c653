"""The plant as nodes on the bus: the true capsule behind its drive, the localiser, the force sensor."""

import math
import secrets
from collections.abc import Callable
from importlib import import_module
from typing import Final

import can
import numpy as np

from controller.limits import Limits
from hil.bus.protection import FrameTransmitter
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import CARRIAGE_MAP, COIL_MAP, INNER_MASS_MAP, FrameMap, frames, heartbeat
from hil.simulated.drive_node import DriveNode
from hil.simulated.faults import DRIVE, Fault
from hil.simulated.lies import Lie, LyingDrive, LyingLocaliser, zero_of
from hil.simulated.makers_drive import MakersDrive
from hil.simulated.power_stage import CarriagePower, CoilPower, InnerMassPower, Power
from plant import layout as at
from plant.drives import Carriage, TrueCoil, TrueVibro
from plant.sensing import Reading
from plant.session import Session

SLOT_S: Final = 1e-3  # the drives' firmware runs this often
_COIL_PARTS: Final = 2  # steps of the plant in a tick: a coil's current is quick
_FORCE_STD_N: Final = 1e-3  # noise of the simulated force cell


def power_of(session: Session, limits: Limits) -> tuple[FrameMap, Power]:
    """Frame map and power stage of the session's drive. Raises ValueError for a drive without frames."""
    drive = session.plant.rig.drive
    if isinstance(drive, Carriage):
        return CARRIAGE_MAP, CarriagePower(limits.carriage_speed_m_s, limits.travel_m, output=session.command)
    if isinstance(drive, TrueCoil):
        return COIL_MAP, CoilPower(limits.current_A, drive.resistance_ohm, drive.inductance_H)
    if isinstance(drive, TrueVibro) and drive.coil is None:
        return INNER_MASS_MAP, InnerMassPower()
    raise ValueError("rig.kind on the bus must be magnetic, coil or vibro with a level; got a vibro drive with a coil")


def simulated_drive(bus: can.BusABC, table: ActuatorTable, power: Power, limits: Limits, tick_s: float) -> MakersDrive:
    """The simulated drive that `table` names. Raises ValueError for a rig without a carriage."""
    if not isinstance(power, CarriagePower):
        raise ValueError("rig.kind must be magnetic with a drive of another maker, whose carriage it is")
    module = import_module(f"hil.simulated.{table.where}_drive")
    double: type[MakersDrive] = getattr(module, f"{table.where.capitalize()}Drive")
    return double(bus, table, power, limits, tick_s)


class PlantNode:
    """`tick(now)` runs once per slot of `SLOT_S`: the drive listens and acts, the sensors send, the plant steps.

    The coil's current loop runs twice per slot. A reading is sent in the first slot after it is available, with its
    age; without a reading for one and a half cycles the localiser sends Valid 0.
    """

    def __init__(
        self,
        session: Session,
        limits: Limits,
        tick_s: float,
        drive_bus: can.BusABC,
        sensor_bus: can.BusABC,
        *,
        force_seed: int | None = None,
        drive: MakersDrive | None = None,
        draw: Callable[[], int] = lambda: secrets.randbits(32),
    ) -> None:
        """`drive`: one of another maker; `draw`: of challenges. Raises ValueError for a rig that is not on the bus."""
        self.slots = round(tick_s / SLOT_S)
        if self.slots < 1 or abs(self.slots * SLOT_S - tick_s) > 1e-9:
            raise ValueError(f"tick_s must be a multiple of the drives' {SLOT_S:g} s; got {tick_s:g}")
        frame_map, power = power_of(session, limits)
        self.session = session
        self._localisers: dict[int, LyingLocaliser] = {}
        self._reported: list[tuple[float, float]] = []
        self._lie: LyingDrive | None = None
        self._now = 0.0
        ours = (drive_bus, frame_map, power, limits, tick_s, draw)
        self.drive: DriveNode | MakersDrive = drive or DriveNode(*ours)
        self._parts = _COIL_PARTS if frame_map is COIL_MAP else 1
        self._localiser = _Localiser(sensor_bus)
        self._force = None if force_seed is None else _ForceSensor(sensor_bus, force_seed)
        self._readings: list[Reading] = []

    def tick(self, now: float) -> None:
        self._now = now
        if isinstance(self.drive.power, CoilPower):
            self.drive.power.output = self._sensed()
        self.drive.listen(now, self.slots)
        self._localiser.speak(now, self._seen(now))
        if self._force is not None:
            self._force.speak(now, float(self.session.newest[at.O_FORCE]))
        begin, span = self.session.time, now + SLOT_S - self.session.time
        for part in range(self._parts):
            command = self.drive.output(span / self._parts, self._sensed())
            if self._lie is not None:
                command = self._lie(begin + span * part / self._parts, span / self._parts, command)
            found = self.session.advance(command, begin + span * (part + 1) / self._parts)
            self._readings += [r for r in found if r.channel == "position_m"]

    @property
    def reported(self) -> list[tuple[float, float]]:
        return [*self._reported, *(one for localiser in self._localisers.values() for one in localiser.reported)]

    def spoil(self, fault: Fault, seed: int = 0) -> None:
        plant, seen = self.session.plant, self.session.instruments.localisation
        if fault.kind == "restless":
            self.drive.power.stray = fault.amount
        elif fault.target == DRIVE:
            self._lie = LyingDrive(fault, plant.rig.drive, self.session.command, float(plant.state[at.S_CURRENT]))
        elif fault.target == "feedback":
            shown = Lie(fault, about=zero_of(plant.rig.drive))
            self.drive.misread = lambda value: shown(self._now, value)
        else:
            self._localisers[id(fault)] = LyingLocaliser(fault, seen, seed, self._position)

    def mend(self, fault: Fault) -> None:
        if fault.kind == "restless":
            self.drive.power.stray = 0.0
        elif fault.target == DRIVE and self._lie is not None:
            self._lie.end()
        elif fault.target == "feedback":
            self.drive.misread = None
        elif id(fault) in self._localisers:
            self._reported += self._localisers.pop(id(fault)).reported

    def _position(self) -> float:
        return float(self.session.newest[at.O_DRIVE if self.session.plant.rig.drive.straight else at.O_INNER_X])

    def _seen(self, now: float) -> list[Reading]:
        readings, self._readings = self._readings, []
        for localiser in self._localisers.values():
            readings = localiser(now, readings)
        return readings

    def _sensed(self) -> float:
        if isinstance(self.drive.power, CoilPower):
            return float(self.session.plant.state[at.S_CURRENT]) if self._lie is None else self._lie.current_A
        if isinstance(self.drive.power, InnerMassPower):
            return float(self.session.newest[at.O_INNER_X] - self.session.newest[at.O_X])
        return self.drive.power.output


class _Sensor:
    def __init__(self, bus: can.BusABC, name: str, beat: str) -> None:
        self._transmitter = FrameTransmitter(bus, (name, beat))
        self._name, self._beat, self._cycle_s = name, beat, frames()[name].cycle_s
        self._said_at, self._beat_at = 0.0, -math.inf

    def say(self, now: float, good: bool, **values: float) -> None:
        """Send its measurement; one that is not `good` is sent as 0 with Valid 0."""
        self._said_at = now
        signals = {name: value if good else 0.0 for name, value in values.items()}
        self._transmitter.say(self._name, signals | {"Valid": float(good)})

    def beat(self, now: float) -> None:
        if now - self._beat_at >= 0.02 - 0.5 * SLOT_S:
            self._beat_at = now
            self._transmitter.say(self._beat, heartbeat(2, now))


class _Localiser(_Sensor):
    """Sends the capsule's position, each reading once, or Valid 0 without a reading."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus, "CapsuleLocalisation", "LocaliserHeartbeat")

    def speak(self, now: float, readings: list[Reading]) -> None:
        due = [(reading.value, now - reading.stamp_s) for reading in readings]
        if not due and now - self._said_at >= 1.5 * self._cycle_s:
            due = [(math.nan, 0.0)]
        for value, age in due:
            good = abs(value) <= 1.1 and 0 <= age <= 0.4
            self.say(now, good, Position_m=value, Quality=1.0, Age_s=age)
        self.beat(now)


class _ForceSensor(_Sensor):
    def __init__(self, bus: can.BusABC, seed: int) -> None:
        super().__init__(bus, "ForceReading", "ForceSensorHeartbeat")
        self._rng, self._said_at = np.random.default_rng(seed), -math.inf

    def speak(self, now: float, force: float) -> None:
        if now - self._said_at >= self._cycle_s - 0.5 * SLOT_S:
            value = force + _FORCE_STD_N * self._rng.standard_normal()
            self.say(now, abs(value) <= 5.0, Force_N=value, Age_s=0.0)
        self.beat(now)
