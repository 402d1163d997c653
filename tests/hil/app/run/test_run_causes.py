"""The true cause of an end is in its sentence: two nodes with the same identifiers, a localisation that is too old."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import can

from hil.app.run.loop import StopSignals
from hil.bus.protection import Sender
from hil.nodes.frame_map import frame_map_of, frames
from hil.nodes.receive import FrameReceiver, Twins
from hil.simulated.medium import SimulatedBus
from hil.simulated.plant_node import SLOT_S, PlantNode
from plant.session import Session
from tests.hil.app.docs.ends import RUN_ENDS
from tests.hil.app.run.test_run_ends import Rig, led
from tests.hil.scripted_bus import ScriptedBus

AGO_S = 2.0
STILL: Any = {"reference": {"kind": "hold", "position_mm": 0.0}}


class Second:
    """Another localiser on the same bus from `since` on, switched on 2 s before."""

    def __init__(self, since: float) -> None:
        self.since = since
        self.plant: PlantNode | None = None
        self.clock = -AGO_S

    def each(self, node: Rig, signals: StopSignals, now: float) -> None:
        """Go on to `now`; it is heard from `since` on."""
        if self.plant is None:
            self.plant = self._made(node)
        while self.clock < now - 1e-9:
            self.plant.tick(self.clock + AGO_S)
            self.clock += SLOT_S

    def _made(self, node: Rig) -> PlantNode:
        bench, loop = node.bench, node.bench.scenario.loop
        session = Session(loop.truth, replace(loop.instruments, feedback=None), 7)
        bus = SimulatedBus(bench.medium, "second")
        plant = PlantNode(session, loop.limits, node.tick_s, bus, bus)
        say, speaks = plant._localiser._transmitter.say, lambda: self.clock >= self.since
        plant._localiser._transmitter.say = lambda *said: say(*said) if speaks() else None  # type: ignore[method-assign]
        plant.drive.transmitter.say = lambda *_: None  # type: ignore[attr-defined]
        return plant


def beats(name: str, uptimes: list[float]) -> Twins:
    """Twins that heard heartbeats with these uptimes, 10 ms apart."""
    frame = frames()[name]
    sender, twins = Sender(frame), Twins(frame)
    for k, up in enumerate(uptimes):
        data = sender.frame({"State": 2, "Uptime_s": up, "Catalogue": frames().fingerprint})
        twins.hear(data, 0.01 * k)
    return twins


def test_two_uptimes_that_interleave_are_two_nodes() -> None:
    both = [up for k in range(5) for up in (100 + 0.02 * k, 3 + 0.02 * k)]
    assert beats("CarriageHeartbeat", both).two(0.1)
    assert not beats("CarriageHeartbeat", both).two(1.0), "they have been silent since"
    assert not beats("CarriageHeartbeat", [100 + 0.01 * k for k in range(20)]).two(0.2)
    assert not beats("CarriageHeartbeat", [100.0, 100.02, 0.3, 0.32, 0.34, 0.36]).two(0.06), "it has booted anew"
    swapped = [100 + 0.02 * (k ^ 1) for k in range(20)]
    assert not beats("CarriageHeartbeat", swapped).two(0.2)


def test_a_frame_that_is_not_whole_is_none() -> None:
    frame = frames()["CarriageHeartbeat"]
    twins = Twins(frame)
    for k in range(20):
        twins.hear(bytes([k % 2] * 8), 0.01 * k)
        twins.hear(bytes(k % 3), 0.01 * k)
    assert not twins.two(0.2)


def test_a_second_localiser_is_named_while_leading(tmp_path: Path) -> None:
    """A stop, whatever was seen of it first. Two drives collide on a wire: those are tried on the local bus."""
    during, node = led(tmp_path, each=Second(1.0).each, seconds=2.0)
    assert (during.end, during.led, RUN_ENDS[during.end].status) == ("stopped", True, 1)
    assert during.ended.startswith("two localisers are on the bus (LocaliserHeartbeat has the uptimes of two)")
    assert node.bench.plant.drive.safe


def test_two_of_a_kind_are_named_before_anything_is_led() -> None:
    """Both beat, so no heartbeat is lost; one of both is refused by its counter."""
    for name, words in (("CarriageHeartbeat", "two drives of the same kind"), ("LocaliserHeartbeat", "two localisers")):
        heartbeat = frames()[name]
        senders, messages = [Sender(heartbeat), Sender(heartbeat)], []
        senders[1].skip(5)
        for k in range(40):
            up = (50.0 if k % 2 else 8.0) + 0.01 * k
            values = {"State": 1, "Uptime_s": up, "Catalogue": frames().fingerprint}
            data = senders[k % 2].frame(values)
            messages.append(can.Message(0.01 * k, heartbeat.id, False, data=data, is_rx=True))
        receiver = FrameReceiver(ScriptedBus(*messages), frame_map_of("magnetic"), 2e-3)
        receiver.listen(0.4)
        assert receiver.doubt(0.4) == f"{words} are on the bus ({name} has the uptimes of two)"


def test_a_localisation_that_is_told_as_too_old_is_named(tmp_path: Path) -> None:
    """Refused frames are not the cause and not named."""
    words = "the localisation is 202 ms old by its own stamp; at most 150 ms is allowed"
    outcome, _ = led(tmp_path, localisation={"latency_s": 0.2})
    assert (outcome.end, RUN_ENDS[outcome.end].status) == ("gave_up", 1)
    assert outcome.ended == f"gave up: the drive was not enabled within 3 s: {words}"
