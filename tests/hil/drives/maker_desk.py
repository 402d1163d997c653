"""Drives of other makers in tests: one whose firmware runs in a thread, to be set up, and one that is led in simulated
time through the adapter, as a controller would.
"""

import threading
import time

import can

from controller.limits import Limits
from hil.app.run.clock import Clock, ClockedBus
from hil.bus.catalogue import load_catalogue
from hil.bus.protection import Sender
from hil.drives.makers import MAKERS
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import ENABLE, OFF, READY, frame_map_of
from hil.nodes.receive import FrameReceiver
from hil.simulated.makers_drive import MakersDrive
from hil.simulated.medium import Medium, SimulatedBus
from hil.simulated.plant_node import SLOT_S, simulated_drive
from hil.simulated.power_stage import CarriagePower
from tests.hil.ticks import TICK

LIMITS = Limits()
NAMES = ("Sync", "CarriageCommand", "ControllerHeartbeat", "DriveReset")
WIRING = frame_map_of("magnetic")


def drive_on(bus: can.BusABC, table: ActuatorTable) -> MakersDrive:
    """A simulated drive of the table at rest."""
    return simulated_drive(bus, table, CarriagePower(LIMITS.carriage_speed_m_s, LIMITS.travel_m), LIMITS, TICK)


class Running:
    """A simulated drive whose firmware runs in a thread of its own."""

    def __init__(self, channel: str, table: ActuatorTable) -> None:
        self.bus = ClockedBus(can.Bus(interface="virtual", channel=channel), Clock())
        self.drive = drive_on(self.bus, table)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        slots = 0
        while not self._over.is_set():
            while slots * SLOT_S <= self.bus.clock.now():
                self.drive.listen(slots * SLOT_S, 2)
                slots += 1
            time.sleep(SLOT_S)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self.bus.shutdown()


class Desk:
    """Adapter and simulated drive on a simulated wire; `heard` is the controller's ear."""

    def __init__(self, table: ActuatorTable, *, booted: bool = True) -> None:
        self.medium = Medium(data_bit_rate=5_000_000)
        near, far = SimulatedBus(self.medium, "controller"), SimulatedBus(self.medium, "drive")
        self.catalogue = load_catalogue()
        self.bus = MAKERS[table.where].bus(near, table, TICK)
        self.drive = drive_on(far, table)
        self.heard = FrameReceiver(self.bus, WIRING, TICK)
        self._senders = {name: Sender(self.catalogue[name]) for name in NAMES}
        self._ticks, self.now, self.place = 0, 0.0, 0.0
        if booted:
            self.ticks(50, OFF)

    def say(self, name: str, values: dict[str, float]) -> None:
        """The controller sends a frame of the catalogue."""
        data = self._senders[name].frame(values)
        self.bus.send(can.Message(arbitration_id=self.catalogue[name].id, is_extended_id=False, data=data))

    def ticks(self, number: int, mode: int, speed_m_s: float = 0.0, *, silent: bool = False) -> None:
        """Ticks of 2 ms; `silent`: the controller says nothing."""
        for _ in range(number):
            self._ticks += 1
            if not silent:
                self.say("Sync", {"Tick": self._ticks, "Period_s": TICK})
                if self._ticks % 10 == 0:
                    self.say("ControllerHeartbeat", {"State": 2, "Uptime_s": 0.0, "Catalogue": 0})
                self.place += speed_m_s * TICK
                self.say("CarriageCommand", WIRING.values(self.place, speed_m_s, mode))
            for _ in range(2):
                self.now += 1e-3
                self.medium.advance(self.now)
                self.drive.listen(self.now, 2)
                self.drive.output(1e-3, 0.0)
            self.heard.listen(self.now)

    def up(self) -> None:
        """Off, ready, enabled."""
        self.ticks(10, OFF)
        self.ticks(20, READY)
        self.ticks(20, ENABLE)

    def until_safe(self, mode: int = ENABLE, *, silent: bool = False) -> float:
        """Go on until the drive is in its safe state; how long that took in s, at most one."""
        began = self.now
        while not self.drive.safe and self.now < began + 1.0:
            self.ticks(1, mode, silent=silent)
        return self.now - began

    def reset(self) -> None:
        """The operator's acknowledgement."""
        self.say("DriveReset", {"Target": 1, "Code": self.heard.fault})
        self.heard.fault = 0
