"""Controllers that answer anything or ask for all there is: nothing unsafe leaves, and from full power it is not far to
rest.
"""

from typing import Any

import can
import numpy as np
import pytest

from controller.signals import Action
from hil.app.sil.testbed import PHASE_S
from hil.bus.protection import Reception
from hil.nodes.frame_map import ENABLE, frames
from hil.nodes.node import FAULTY, RUNNING
from hil.simulated.plant_node import SLOT_S
from hil.simulated.power_stage import CarriagePower
from plant import layout as at
from tests.hil.app.sil.sil_benches import Full, bench_of, go
from tests.hil.app.sil.sil_runs import RIGS


class Wild:
    """A controller that answers anything, or nothing."""

    name = "wild"

    def __init__(self) -> None:
        self.rng = np.random.default_rng(5)

    def reset(self, *_: object) -> None:
        """Nothing to remember."""

    def act(self, *_: object) -> object:
        """NaN, infinities, jumps, other types, exceptions."""
        kind = int(self.rng.integers(8))
        if kind == 0:
            raise RuntimeError("wild")
        values: tuple[Any, ...] = (float("nan"), float("inf"), -1e9, 1e9, "text", None, float(self.rng.normal()))
        return Action(values[kind - 1], "ok") if kind != 7 else Action(float(self.rng.normal()), "ok")


@pytest.mark.parametrize("kind", RIGS)
def test_whatever_the_controller_does_nothing_unsafe_leaves(kind: str) -> None:
    """The supervisor taken out, a wild controller straight on the guard: what is on the wire is within range and slew
    all the same.
    """
    bench = bench_of(kind)
    wild, node = Wild(), bench.node
    node.supervisor = wild  # type: ignore[assignment]
    original = wild.act

    def act(*words: object) -> object:
        try:
            return original(*words)
        except RuntimeError:
            return Action(float("nan"), "failed")

    wild.act = act  # type: ignore[method-assign]
    wild.active = "wild"  # type: ignore[attr-defined]
    frame = frames()[bench.frame_map.command]
    reception, told = Reception([frame]), []

    def look(message: can.Message) -> None:
        if message.arbitration_id == frame.id and not message.is_rx:
            told.append(reception.accept(frame.id, message.data, message.timestamp))

    node.guard._observe = look
    states: list[int] = []
    for _ in range(20):
        node.start(bench.time_s, 0.0)
        go(bench, 0.05)
        states.append(node.state)
    assert states.count(RUNNING) >= 5  # it is started again and again
    assert states.count(FAULTY) >= 5  # and a wild controller is found out
    fence, moving = node.guard.fence, [v for v in told if isinstance(v, dict)]
    assert len(moving) == len(told) == 500
    values = np.array([v[bench.frame_map.signal] for v in moving])
    enabled = np.array([v["Mode"] == ENABLE for v in moving])
    assert enabled.sum() > 20
    assert values.min() >= fence.low - 1e-6
    assert values.max() <= fence.high + 1e-6
    steps = np.abs(np.diff(values))[enabled[1:] & enabled[:-1]]
    assert steps.max() <= fence.rate * bench.tick_s * (1 + 1e-6) + 2 * frame.field(bench.frame_map.signal).scale
    rows = np.concatenate(bench.plant.session.rows)
    if kind == "coil":
        assert np.abs(rows[:, at.O_CURRENT]).max() <= 1.3


@pytest.mark.parametrize(("kind", "allowed_s"), [("magnetic", 0.020), ("coil", 0.010), ("vibro", 0.010)])
@pytest.mark.parametrize("phase", [0, 1])
def test_from_full_power_to_the_safe_state_when_the_controller_dies(kind: str, allowed_s: float, phase: int) -> None:
    """The carriage at its full speed, the coil at its full current: from the last good frame to rest within what the
    drive is allowed.
    """
    bench = bench_of(kind)
    bench.node.supervisor = Full()  # type: ignore[assignment]
    bench.node.start(0.0, 0.0)
    go(bench, 0.2)
    drive, power = bench.plant.drive, bench.plant.drive.power
    if isinstance(power, CarriagePower):
        assert power.rate == pytest.approx(bench.node.guard.fence.rate)
    else:
        assert power.output == pytest.approx(bench.node.guard.fence.high, rel=0.02)
    if phase:
        bench.slot(0)
        bench.medium.advance(bench.time_s + bench.tick_s)
    now = bench.time_s + (2 if phase else 0) * SLOT_S + PHASE_S
    while not drive.safe:
        bench.medium.advance(now)
        bench.plant.tick(now)
        now += SLOT_S
    assert now - drive.good_at <= allowed_s


@pytest.mark.parametrize(("kind", "allowed_s"), [("magnetic", 0.025), ("coil", 0.010), ("vibro", 0.010)])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_from_full_power_to_the_safe_state_when_the_drive_is_not_heard(kind: str, allowed_s: float, way: float) -> None:
    """From the last good feedback to rest, the time to brake and the current's decay included."""
    fault = {"kind": "drop", "at_s": 0.2, "target": "feedback"}
    bench = bench_of(kind, fault)
    bench.node.supervisor = Full(way)  # type: ignore[assignment]
    bench.node.start(0.0, 0.0)
    go(bench, 0.2)
    drive, receiver = bench.plant.drive, bench.node.receiver
    assert not drive.safe
    heard_at = 0.2
    while not drive.safe:
        bench.begin_tick()
        heard_at = bench.time_s - receiver.evidence(bench.time_s).feedback_s
        for number in range(bench.slots):
            end = bench.slot(number) + SLOT_S
            if drive.safe:
                break
        bench.end_tick()
    assert heard_at < 0.2
    assert end - heard_at <= allowed_s
