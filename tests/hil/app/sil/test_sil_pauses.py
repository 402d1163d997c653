"""A controller that gets no processor for a while, ticks that begin late, clocks that jump: ridden through or
stopped.
"""

import numpy as np
import pytest

from hil.nodes.frame_map import ENABLED, QUICK_STOP_M_S2
from hil.nodes.node import FAULTY, RUNNING
from plant import layout as at
from tests.hil.app.sil.sil_benches import Full, bench_of, go, pause


@pytest.mark.parametrize(
    ("kind", "silent_ticks"), [("magnetic", 1), ("magnetic", 3), ("magnetic", 7), ("coil", 1), ("coil", 2)]
)
def test_a_pause_within_the_commands_life_is_ridden_through(kind: str, silent_ticks: int) -> None:
    """The controller gets no processor for some ticks: the drive lives on its last command, the node catches up and
    goes on.
    """
    bench = bench_of(kind)
    bench.node.start(0.0, 0.0)
    go(bench, 0.3)
    restarts = bench.node.estimator.counts.restarts
    pause(bench, silent_ticks)
    go(bench, 0.2)
    assert (bench.node.state, bench.node.reason) == (RUNNING, "")
    assert bench.plant.drive.stage.state == ENABLED
    assert bench.plant.drive.rejected == 0
    assert bench.node.estimator.counts.restarts == restarts
    estimate = bench.node.tick(bench.time_s).estimate
    truth = np.concatenate(bench.plant.session.rows)[-1, at.O_X]
    assert abs(estimate.state[0] - truth) < 0.5e-3


@pytest.mark.parametrize(("kind", "silent_ticks"), [("magnetic", 9), ("magnetic", 15), ("coil", 3), ("coil", 15)])
def test_a_longer_pause_is_told_from_a_jump_of_the_clock(kind: str, silent_ticks: int) -> None:
    """Both stop the drive for good; in a pause the drive's reports have filled the time, in a jump nobody has said
    anything.
    """
    paused, jumped = bench_of(kind), bench_of(kind)
    for bench in (paused, jumped):
        bench.node.start(0.0, 0.0)
        go(bench, 0.3)
    pause(paused, silent_ticks)
    paused.begin_tick()
    jumped.node.tick(jumped.time_s + silent_ticks * jumped.tick_s)
    told = f"controller paused for {(silent_ticks + 1) * paused.tick_s:.2g} s"
    assert (paused.node.state, paused.node.reason) == (FAULTY, told)
    assert (jumped.node.state, jumped.node.reason) == (FAULTY, "clock jumped")
    for bench in (paused, jumped):
        go(bench, 0.1)
        assert bench.plant.drive.safe


@pytest.mark.parametrize("kind", ["magnetic", "coil"])
@pytest.mark.parametrize("seconds", [0.2, 1.0, 5.0])
def test_a_pause_of_any_length_is_named_with_its_length(kind: str, seconds: float) -> None:
    """More waits after it than a tick reads; the drive's reports that were read do not fill the time, and need not."""
    bench = bench_of(kind)
    bench.node.start(0.0, 0.0)
    go(bench, 0.3)
    pause(bench, round(seconds / bench.tick_s) - 1)
    bench.begin_tick()
    assert (bench.node.state, bench.node.reason) == (FAULTY, f"controller paused for {seconds:g} s")
    assert bench.node.receiver.full == (seconds > 0.2)


@pytest.mark.parametrize("silent_ticks", [2, 5, 500])
def test_a_pause_between_a_ticks_begin_and_its_reading_is_the_controllers(silent_ticks: int) -> None:
    """Feedback has come all the time, after the begin of the tick that reads it: it was not lost."""
    bench = bench_of("magnetic")
    bench.node.start(0.0, 0.0)
    go(bench, 0.3)
    began = bench.time_s
    pause(bench, silent_ticks)
    bench.node.tick(began)
    assert bench.node.state == FAULTY
    assert bench.node.reason.startswith("controller paused for ")
    assert bench.plant.session.time - began > silent_ticks * bench.tick_s - 1e-3


@pytest.mark.parametrize("late_s", [0.4e-3, 1.1e-3, 1.9e-3])
def test_a_late_tick_is_still_its_own(late_s: float) -> None:
    """Each third tick begins late, the next one on time and so after less than a period: no tick is missed, none counts
    twice.
    """
    bench = bench_of("magnetic")
    bench.node.start(0.0, 0.0)
    go(bench, 0.3)
    ahead = []
    for k in range(200):
        tick = bench.node.tick(bench.time_s + (late_s if k % 3 == 1 else 0.0))
        pause(bench, 1)
        ahead.append(tick.estimate.state[0] - np.concatenate(bench.plant.session.rows)[-1, at.O_X])
    assert (bench.node.state, bench.node.reason) == (RUNNING, "")
    assert bench.node.estimator.counts.restarts == 0
    assert np.abs(ahead).max() < 0.5e-3


def test_a_fast_carriage_s_command_lives_shorter_by_the_time_to_brake() -> None:
    """The whole way to rest takes 18 ms at most, whatever the speed; what the node rides through follows."""
    frame_map = bench_of("magnetic").frame_map
    for speed in np.linspace(-0.25, 0.25, 21):
        assert frame_map.life_ms(speed) + 1e3 * abs(speed) / QUICK_STOP_M_S2 <= 18
    assert (frame_map.life_ms(0.0), frame_map.life_ms(0.25)) == (18, 8)
    bench = bench_of("magnetic")
    bench.node.supervisor = Full()  # type: ignore[assignment]
    bench.node.start(0.0, 0.0)
    go(bench, 0.3)
    pause(bench, 5)
    bench.begin_tick()
    assert (bench.node.state, bench.node.reason) == (FAULTY, "controller paused for 0.012 s")


@pytest.mark.parametrize("strange", [float("nan"), float("inf"), -1e300, 1e300])
def test_a_strange_clock_stops_and_raises_nothing(strange: float) -> None:
    bench = bench_of()
    bench.node.start(0.0, 0.0)
    go(bench, 0.2)
    assert bench.plant.drive.stage.state == ENABLED
    bench.node.tick(strange)
    assert (bench.node.state, bench.node.reason) == (FAULTY, "clock jumped")
    go(bench, 0.1)
    assert bench.plant.drive.safe
