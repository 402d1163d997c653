"""What a run in real time is measured and paced by: the rehearsal, quantiles, the grid of ticks, stamps of frames."""

import time

import can
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.app.run.check import rehearse
from hil.app.run.clock import Clock, ClockedBus, Grid, Histogram
from hil.app.scenario.deployment import parse_deployment
from hil.bus.local import LocalBus
from hil.simulated.medium import Medium, SimulatedBus
from models.theta import Theta
from tests.hil.app.run.deployments import deployment
from tests.hil.scripted_bus import ScriptedBus


def test_rehearsal_runs_every_controller_of_the_rig() -> None:
    for name in ("feedforward", "mpc"):
        task = parse_deployment(deployment(control=f'controller = "{name}"'), Theta()).task()
        took = rehearse(task, 120)
        assert 0 < took.quantile(0.5) <= took.longest_s


@given(st.lists(st.floats(0, 0.019), min_size=1, max_size=200), st.floats(0.01, 1))
def test_quantiles_are_those_of_the_numbers(seconds: list[float], share: float) -> None:
    histogram = Histogram()
    for one in seconds:
        histogram.add(one)
    exact = float(np.quantile(seconds, share, method="inverted_cdf"))
    assert exact - 1e-12 <= histogram.quantile(share) <= exact + 2e-6
    assert histogram.longest_s == max(seconds)


def test_the_grid_skips_what_it_missed() -> None:
    grid = Grid(Clock(), 0.002)
    first = grid.wait()
    time.sleep(0.0205)
    late = grid.wait()
    assert late - first > 0.02
    assert grid.missed >= 9
    points = (grid.wait() - first) / 0.002
    assert points >= grid.missed + 2
    assert grid.ticks == 3


def test_stamps_are_of_the_nodes_clock(channel: str) -> None:
    """A driver's stamp counts while it is plausible; a step of the calendar's clock does not reach the node."""
    with LocalBus(channel) as far, ClockedBus(LocalBus(channel), Clock()) as near:
        far.send(can.Message(arbitration_id=1, is_extended_id=False))
        time.sleep(0.02)
        got = near.recv(1)
        assert got is not None
        assert near.clock.now() - got.timestamp >= 0.02
        near.inner._inbox.append(can.Message(time.time() + 3600, 1, False, is_rx=False))  # type: ignore[attr-defined]
        odd = near.recv(1)
        assert odd is not None
        assert odd.is_rx
        assert abs(odd.timestamp - near.clock.now()) < 0.1
        assert near.unstamped == 1
        assert round(got.timestamp * 1e9) / 1e9 == got.timestamp


def test_what_state_the_bus_is_in_is_told() -> None:
    """A node whose error counters made it passive shows so through the clock's bus."""
    inner = SimulatedBus(Medium(1_000_000), "near")
    with ClockedBus(inner, Clock()) as near:
        states = [near.state]
        inner.counters.transmit = 128
        states.append(near.state)
        assert states == [can.BusState.ACTIVE, can.BusState.PASSIVE]


class Garbled(ScriptedBus):
    """An interface that raises as it is closed."""

    opened = ended = False

    def shutdown(self) -> None:
        self.ended = self.opened
        super().shutdown()
        if self.opened:
            raise IndexError("a line of the interface is garbled")


def test_an_interface_that_raises_as_it_is_closed_is_closed() -> None:
    """A run has an end and a status all the same."""
    inner = Garbled()
    inner.opened = True
    with ClockedBus(inner, Clock()):
        assert not inner.ended
    assert inner.ended
