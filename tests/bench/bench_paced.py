"""A paced loop over python-can's virtual bus: estimator, MPC under the supervisor, protected frames, plant, 5,000 ticks
of 1 ms.

`python -m tests.bench.bench_paced [--ticks 5000] [--tick_ms 1]`. From the begin of a tick by the
clock: frames received and checked, estimate, plan, command sent; what is left of the tick is the plant's. A tick is
missed where its command goes out after the tick's end. Times by the wall clock suffer from whatever else the machine
does, the thread's own processor time hardly: both are printed.
"""

import argparse
import gc
import os
import time
from dataclasses import dataclass, field

import can
import numpy as np

from controller.drives import envelope_of
from controller.model.control_model import control_model
from controller.reference import by_speeds
from controller.signals import Measurement
from controller.step.compiled import supervisor_of
from hil.app.scenario.deployment import PLANNING
from hil.bus.catalogue import load_catalogue
from hil.bus.codec import Refusal
from hil.bus.protection import Receiver, Sender
from models.theta import Theta
from plant.drives import TrueMagnet
from plant.rig import Truth
from plant.session import Session
from tests.controller.loops import believed

WARM = 50
MODE_ENABLE = 2


@dataclass
class Port:
    """One side of the bus: protected frames by name."""

    bus: can.BusABC
    names: tuple[str, ...]
    heard: tuple[str, ...]
    senders: dict[str, Sender] = field(init=False)
    receivers: dict[int, Receiver] = field(init=False)

    def __post_init__(self) -> None:
        self.catalogue = load_catalogue()
        self.senders = {name: Sender(self.catalogue[name]) for name in self.names}
        self.receivers = {self.catalogue[name].id: Receiver(self.catalogue[name]) for name in self.heard}

    def send(self, name: str, values: dict[str, float]) -> None:
        """One protected frame."""
        data = self.senders[name].frame(values)
        self.bus.send(can.Message(arbitration_id=self.catalogue[name].id, data=data, is_extended_id=False))

    def receive(self, now: float) -> list[tuple[str, dict[str, float]]]:
        """The good frames that are at hand."""
        found = []
        while (message := self.bus.recv(0.0)) is not None:
            receiver = self.receivers.get(message.arbitration_id)
            values = receiver.accept(message.data, now) if receiver is not None else None
            if receiver is not None and values is not None and not isinstance(values, Refusal):
                found.append((receiver.frame.name, values))
        return found


class Peer:
    """The rig at the other end of the bus."""

    def __init__(self, bus: can.BusABC) -> None:
        self.port = Port(bus, ("CapsuleLocalisation", "CarriageFeedback"), ("CarriageCommand",))
        self.session = Session(Truth(TrueMagnet(24.2), hoop_factor=1.09), seed=1)
        self.command, self.rate = 0.0, 0.0

    def go_on(self, until_s: float) -> None:
        """Take the newest command, move on, report what the instruments gave."""
        for _, values in self.port.receive(until_s):
            self.rate, self.command = values["Velocity_m_s"], values["Position_m"]
        for r in self.session.advance(self.command, until_s):
            age = until_s - r.stamp_s
            if r.channel == "position_m":
                self.port.send("CapsuleLocalisation", {"Position_m": r.value, "Quality": 1.0, "Age_s": age, "Valid": 1})
            else:
                seen = {"Position_m": r.value, "Velocity_m_s": self.rate, "State": 4, "Temperature_degC": 25.0}
                self.port.send("CarriageFeedback", seen)


def measured(frames: list[tuple[str, dict[str, float]]], now: float) -> list[Measurement]:
    """What frames say, stamped."""
    places = [
        Measurement("position_m", v["Position_m"], now - v["Age_s"]) for n, v in frames if n == "CapsuleLocalisation"
    ]
    return places + [
        Measurement("carriage_position_m", v["Position_m"], now) for n, v in frames if n == "CarriageFeedback"
    ]


def paced(ticks: int, tick_s: float, in_c: bool) -> dict[str, np.ndarray]:
    """Run the loop with the controller in C or in Python; (ticks,) of tick to sent, the thread's own time and that of
    estimate and command in ms, error in mm, whether the plan was cut or failed.
    """
    model = control_model(believed(), Theta(), tick_s)
    envelope, reference = envelope_of(model.drive), by_speeds([0.0, 1e-3], [0.3, ticks * tick_s])
    supervisor = supervisor_of("mpc", model, envelope, PLANNING * tick_s, in_c)
    estimator = supervisor.observer_for("mpc", model, "default")
    buses = [can.Bus(interface="virtual", channel="paced") for _ in range(2)]
    port, peer = Port(buses[0], ("CarriageCommand",), ("CapsuleLocalisation", "CarriageFeedback")), Peer(buses[1])
    sent, own, step, error = (np.zeros(ticks) for _ in range(4))
    odd = np.zeros(ticks, dtype=bool)
    gc.collect()
    gc.freeze()
    began = time.perf_counter() + 0.01
    for k in range(ticks):
        now, due = k * tick_s, began + k * tick_s
        while time.perf_counter() < due:
            pass
        mine = time.thread_time()
        arrived = measured(port.receive(now), now)
        began_step = time.thread_time()
        action = supervisor.act(now, estimator.observe(now, supervisor.issued.command, arrived), reference)
        step[k] = 1e3 * (time.thread_time() - began_step)
        speed = min(max(supervisor.issued.rate, -0.4), 0.4)
        port.send(
            "CarriageCommand",
            {"Position_m": action.command, "Velocity_m_s": speed, "TimeToLive_ms": 10, "Mode": MODE_ENABLE},
        )
        sent[k], own[k] = 1e3 * (time.perf_counter() - due), 1e3 * (time.thread_time() - mine)
        odd[k] = action.status != "ok" or action.cut_after is not None
        peer.go_on(now + tick_s)
        error[k] = 1e3 * (peer.session.rows[-1][-1, 1] - float(reference.position(np.array([now]))[0]))
    gc.unfreeze()
    for bus in buses:
        bus.shutdown()
    return {"sent": sent[WARM:], "own": own[WARM:], "step": step[WARM:], "error": error[WARM:], "odd": odd[WARM:]}


def main() -> None:
    """Print the figures of one run."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--ticks", type=int, default=5000)
    options.add_argument("--tick_ms", type=float, default=1.0)
    chosen = options.parse_args()
    print(f"{chosen.ticks} ticks of {chosen.tick_ms:g} ms, load {os.getloadavg()[0]:.1f}")
    for in_c in (False, True):
        print("controller in C" if in_c else "controller in Python")
        report(paced(chosen.ticks + WARM, 1e-3 * chosen.tick_ms, in_c), chosen.tick_ms)


def report(found: dict[str, np.ndarray], tick_ms: float) -> None:
    """Print the figures of one controller."""
    of = {"tick to sent, wall ms": "sent", "the same, own ms": "own", "estimate and command, own": "step"}
    for name, times in ((name, found[key]) for name, key in of.items()):
        print(f"{name:25s} median {np.median(times):.3f}  p99 {np.percentile(times, 99):.3f}  max {times.max():.3f}")
    late = [int(np.sum(times > tick_ms)) for times in (found["sent"], found["own"])]
    print(
        f"commands after the tick's end {late[0]} by the wall, {late[1]} by own time; plans cut or not ok"
        f" {int(found['odd'].sum())}"
    )
    print(f"tracking rmse {np.sqrt(np.mean(found['error'] ** 2)):.3f} mm")


if __name__ == "__main__":
    main()
