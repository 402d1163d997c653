"""The two ends of a wire with a CiA 402 drive: the adapter and what is heard behind it, and a simulated drive that
answers.
"""

import threading
import time

import can
import pytest

from controller.limits import Limits
from hil.app.run.clock import Clock, ClockedBus
from hil.bus.catalogue import load_catalogue
from hil.bus.protection import Sender
from hil.drives.cia402_bus import Cia402Bus
from hil.drives.cia402_protocol import Cia402Table
from hil.nodes.frame_map import frame_map_of
from hil.simulated.power_stage import CarriagePower
from tests.hil.ticks import TICK

LIMITS, TABLE = Limits(), Cia402Table()


class Ends:
    """An adapter with its two ends: `far` is where the drive hears and speaks."""

    def __init__(self, name: str, table: Cia402Table = TABLE) -> None:
        self.far = can.Bus(interface="virtual", channel=name)
        self.catalogue = load_catalogue()
        self.near = Cia402Bus(can.Bus(interface="virtual", channel=name), table, TICK)
        self._senders: dict[str, Sender] = {}

    def say(self, name: str, values: dict[str, float]) -> None:
        """The controller sends a frame of the catalogue."""
        sender = self._senders.setdefault(name, Sender(self.catalogue[name]))
        self.near.send(
            can.Message(arbitration_id=self.catalogue[name].id, is_extended_id=False, data=sender.frame(values))
        )

    def told(self) -> list[tuple[int, bytes]]:
        """What came out at the drive's end."""
        found = []
        while (message := self.far.recv(0)) is not None:
            found.append((message.arbitration_id, bytes(message.data)))
        return found

    def show(self, identifier: int, data: bytes) -> list[can.Message]:
        """The drive says something; what the controller hears of it."""
        self.far.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data))
        found = []
        while (message := self.near.recv(0)) is not None:
            found.append(message)
        return found

    def close(self) -> None:
        self.near.shutdown()
        self.far.shutdown()


def command(mode: int, place: float) -> dict[str, float]:
    return frame_map_of("magnetic").values(place, 0.0, mode)


class Polled:
    """A simulated drive whose firmware runs in a thread of its own."""

    def __init__(self, channel: str, table: Cia402Table = TABLE) -> None:
        drive = pytest.importorskip("hil.simulated.cia402_drive", reason="needs the package canopen (extra canopen)")
        self.bus = ClockedBus(can.Bus(interface="virtual", channel=channel), Clock())
        power = CarriagePower(LIMITS.carriage_speed_m_s, LIMITS.travel_m)
        self.drive = drive.Cia402Drive(self.bus, table, power, LIMITS, TICK)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.is_set():
            self.drive.listen(self.bus.clock.now(), 2)
            time.sleep(5e-4)

    def halt(self) -> None:
        """From now on the test itself runs the firmware."""
        self._over.set()
        self._thread.join()

    def close(self) -> None:
        self.halt()
        self.bus.shutdown()
