"""Commands that come late, by little or ever more: a drive follows none that is older than a tick and its time to
live.
"""

import math
from typing import Any

import can
import numpy as np
import pytest

from hil.bus.codec import Codec
from hil.nodes.frame_map import frames
from hil.nodes.node import RUNNING
from hil.simulated.state_machine import SyncClock
from tests.hil.app.sil.sil_benches import Full, bench_of, go
from tests.hil.app.sil.sil_runs import RIGS, run

LIFE_S = {"magnetic": 0.018, "coil": 0.006, "vibro": 0.006}
AT_S = 0.3


def growing(target: str, step_s: float, every_s: float, at_s: float = AT_S) -> list[dict[str, Any]]:
    """Delays of one step, two, three, ... up to ten, each for a while."""
    return [
        {
            "kind": "delay",
            "at_s": at_s + every_s * k,
            "duration_s": every_s,
            "target": target,
            "value": step_s * (k + 1),
        }
        for k in range(10)
    ]


@pytest.mark.parametrize("target", ["commands", "all"])
@pytest.mark.parametrize("step_s", [0.002, 0.004])
@pytest.mark.parametrize("kind", RIGS)
def test_delays_that_grow_by_less_than_a_life_are_noticed(kind: str, step_s: float, target: str) -> None:
    """The last command that is followed is no older than a tick and its life, and the drive is safe that long after it
    began at most.
    """
    trace, _ = run(kind, 0.6, *growing(target, step_s, 0.02))
    t, safe, good = trace.slots.T
    first = np.flatnonzero((t > AT_S) & (safe > 0))[0]
    assert safe[first:].all()
    assert t[first] - good[first] <= {"magnetic": 0.020, "coil": 0.010, "vibro": 0.010}[kind]
    delay = step_s * math.floor((good[first] - AT_S) / 0.02 + 1)
    assert delay <= 0.002 + LIFE_S[kind]


@pytest.mark.parametrize("target", ["commands", "all"])
@pytest.mark.parametrize(
    ("kind", "delay_s"), [("magnetic", 0.003), ("magnetic", 0.006), ("coil", 0.003), ("vibro", 0.003)]
)
def test_a_small_delay_is_ridden_through(kind: str, delay_s: float, target: str) -> None:
    trace, found = run(
        kind, 0.6, {"kind": "delay", "at_s": AT_S, "duration_s": 9.0, "value": delay_s, "target": target}
    )
    assert math.isnan(found[0].safe_after_s)
    assert trace.stopped_because == ""


@pytest.mark.parametrize("delay_s", [0.009, 0.015, 0.021, 0.029])
@pytest.mark.parametrize("kind", RIGS)
def test_a_drive_is_not_led_up_by_commands_that_are_always_late(kind: str, delay_s: float) -> None:
    trace, _ = run(kind, 0.5, {"kind": "delay", "at_s": 0.0, "duration_s": 9.0, "value": delay_s})
    old = delay_s > 0.002 + LIFE_S[kind]
    assert trace.slots[:, 1].all() == old
    assert (trace.rejected > 100) == old


@pytest.mark.parametrize("kind", RIGS)
def test_delays_that_grow_at_full_power(kind: str) -> None:
    """The carriage at its full speed, whose life is 8 ms. A coil's capsule soon goes 2 m/s, past what its filter
    follows: the delays begin before.
    """
    at_s = 0.2
    bench = bench_of(kind, *growing("commands", 0.002, 0.006, at_s))
    bench.node.supervisor = Full()  # type: ignore[assignment]
    bench.node.start(0.0, 0.0)
    go(bench, at_s)
    drive = bench.plant.drive
    assert not drive.safe
    go(bench, 0.04)
    assert drive.safe
    assert drive.good_at - at_s < {"magnetic": 0.042, "coil": 0.024, "vibro": 0.024}[kind]


def test_ticks_begin_where_the_fastest_sync_says() -> None:
    ticks = SyncClock()
    assert ticks.begin(7, 5.0) == 5.0
    for n, late in enumerate([0.003, 0.001, 0.0, 0.002, 0.004]):
        ticks.sync(n, 100 + n, 0.002, 1.0 + 0.002 * n + late)
    stamp = 1.012
    assert ticks.begin(4, stamp) == pytest.approx(1.008, abs=1e-5)
    assert ticks.begin(2, stamp) == pytest.approx(1.004, abs=1e-5)
    assert ticks.begin(5, stamp) == pytest.approx(0.978, abs=1e-5), (
        "SYNC 5 is not due for long: it is the one of a round before"
    )


def test_commands_are_dated_while_sync_is_missing() -> None:
    ticks = SyncClock()
    ticks.sync(15, 15, 0.002, 1.030)
    for n in range(16, 60):
        assert ticks.begin(n % 16, 1.0 + 0.002 * n + 0.0004) == pytest.approx(1.0 + 0.002 * n)


def test_another_controller_begins_anew_after_a_silence_and_not_before() -> None:
    ticks = SyncClock()
    assert ticks.sync(5, 500, 0.002, 1.0)
    for tick in (0, 500, 5000):
        assert not ticks.sync(0, tick, 0.002, 1.01)
        assert ticks.begin(5, 1.0004) == pytest.approx(1.0)
    assert ticks.sync(10, 505, 0.002, 1.01)
    assert ticks.sync(0, 0, 0.002, 1.08)
    assert ticks.begin(0, 1.0804) == pytest.approx(1.08)
    assert ticks.sync(3, 3, 0.002, 7.0)
    assert ticks.begin(3, 7.0004) == pytest.approx(7.0)


def test_clocks_may_drift() -> None:
    """A controller whose clock is 200 ppm slow, over ten minutes: no command looks older than it is by more than a
    tenth of a tick.
    """
    ticks = SyncClock()
    for n in range(300_000):
        stamp = 0.002 * n * 1.0002
        ticks.sync(n % 16, n, 0.002, stamp)
        assert stamp - ticks.begin(n % 16, stamp) < 2e-4


def test_sync_goes_on_with_the_time_where_ticks_are_missed() -> None:
    bench = bench_of("magnetic")
    bench.node.start(0.0, 0.0)
    codec, told = Codec(frames()["Sync"]), []

    def look(message: can.Message) -> None:
        if message.arbitration_id == codec.frame.id:
            values = codec.decode(int.from_bytes(message.data, "little"))
            assert isinstance(values, dict)
            told.append(int(values["Tick"]))

    bench.node.guard._observe = look
    go(bench, 0.3)
    for _ in range(3):
        for number in range(bench.slots):
            bench.slot(number)
        bench.end_tick()
    go(bench, 0.1)
    assert told == [*range(150), *range(153, 203)]
    assert bench.node.state == RUNNING
    assert not bench.plant.drive.safe
