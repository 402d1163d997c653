"""A controller and its drive that only act as such on the local bus: they tell the story, and heed an operator."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import can

from hil.bus.local import LocalBus
from hil.bus.protection import Receiver, Sender
from hil.nodes.frame_map import MOVING, STANDBY
from tests.hil.app.cockpit.story import CATALOGUE, said


class Puppet:
    """Speaks until it is `ended`, in its own time, which falls behind the clock on a busy machine and never hurries.
    After a SafeStop its drive stands by. `held` is how many setpoints came with the switch held, the last `speed_m_s`.
    """

    def __init__(self, channel: str) -> None:
        self.ended = threading.Event()
        self.mute = threading.Event()
        self.stopped, self.held, self.released, self.speed_m_s = False, 0, 0, 0.0
        self._channel = channel
        self._senders = {name: Sender(frame) for name, frame in CATALOGUE.frames.items()}
        self._ears = {CATALOGUE[n].id: Receiver(CATALOGUE[n]) for n in ("OperatorSetpoint", "SafeStop")}

    def run(self) -> None:
        """Speak and listen."""
        with LocalBus(self._channel) as bus:
            ms, due = 0, time.monotonic()
            while not self.ended.is_set():
                due = max(due + 0.01, time.monotonic() - 0.01)
                for _ in range(10):
                    self._speak(bus, ms)
                    ms += 1
                for message in iter(lambda: bus.recv(0), None):
                    self._hear(message)
                time.sleep(max(due - time.monotonic(), 0.0))

    def _speak(self, bus: LocalBus, ms: int) -> None:
        if self.mute.is_set():
            return
        told = list(said(ms))
        if ms % 50 == 0:
            status = {"State": 2.0 if self.held else 1.0, "Source": 2.0 if self.held else 0.0, "Refused": 0.0}
            told.append(("OperatorStatus", {**status, "Position_m": 0.0, "Velocity_m_s": self.speed_m_s}))
        for name, values in told:
            if self.stopped and values.get("State") in MOVING and name == "CarriageFeedback":
                values["State"] = STANDBY
            if self.stopped and name == "WantedMotion":
                values["Following"] = 0.0
            data = self._senders[name].frame(values)
            bus.send(can.Message(arbitration_id=CATALOGUE[name].id, is_extended_id=False, data=data))

    def _hear(self, message: can.Message) -> None:
        ear = self._ears.get(message.arbitration_id)
        values = ear.accept(message.data, message.timestamp) if ear is not None else None
        if not isinstance(values, dict):
            return
        if "Reason" in values:
            self.stopped = True
        elif values["DeadMan"]:
            self.held, self.released, self.speed_m_s = self.held + 1, 0, values["Velocity_m_s"]
        else:
            self.held, self.released, self.speed_m_s = 0, self.released + 1, 0.0


@contextmanager
def puppet_on(channel: str) -> Iterator[Puppet]:
    """A puppet for the time of the block."""
    puppet = Puppet(channel)
    thread = threading.Thread(target=puppet.run)
    thread.start()
    try:
        yield puppet
    finally:
        puppet.ended.set()
        thread.join()
