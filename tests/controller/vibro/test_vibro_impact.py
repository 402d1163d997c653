"""Which stop a cycle strikes: told from the swing, chosen by energy among the alternatives."""

from dataclasses import replace

import pytest

from controller.vibro.cycles import Cycles, Gait, VibroModel, impact_of
from controller.vibro.drive_map import free_period, speed_map, squares
from controller.vibro.waveform import Waveform
from models.drives.vibro import Stop
from tests.bench.least_energy import cheapest, optima
from tests.controller.vibro.vibro_runs import gut_model

NEAR_M = 4e-3


def near(front: float | None, rear: float | None) -> VibroModel:
    """The shipped gut rig with its stops elsewhere."""
    model = gut_model()
    stops = [None if gap is None else Stop(gap, 2e4) for gap in (front, rear)]
    return replace(model, drive=replace(model.drive, front=stops[0], rear=stops[1]))


@pytest.mark.parametrize(
    ("swing", "impact"),
    [((1e-3, 1e-3), "none"), ((5e-3, 1e-3), "front"), ((1e-3, 5e-3), "rear"), ((5e-3, 5e-3), "both")],
)
def test_an_impact_is_a_swing_beyond_the_gap(swing: tuple[float, float], impact: str) -> None:
    gait = Gait(1e-2, 0.1, 0.1, *swing, peak_m_s=0.1)
    assert impact_of(near(NEAR_M, NEAR_M), gait) == impact
    assert impact_of(near(None, None), gait) == "none"


def test_a_stop_stands_in_the_way_of_the_swing() -> None:
    strong = Waveform.square(1.05 * free_period(near(None, None)), 0.3, 0.8)
    free, stopped = (Cycles(near(gap, None)).gait(strong) for gap in (None, NEAR_M))
    assert free.front_m > 1.5 * NEAR_M
    assert NEAR_M < stopped.front_m < 1.2 * NEAR_M


def test_every_alternative_goes_at_the_speed_and_strikes_what_it_says() -> None:
    cycles = Cycles(near(NEAR_M, NEAR_M))
    table = speed_map(cycles, (0.8, 1.0, 1.1, 1.2), (0.2, 0.25, 0.3), (0.15, 0.2, 0.3, 0.5))
    found = squares(cycles, table, 12e-3)
    assert len({one.impact for one in found}) == len(found) >= 2
    found += optima(cycles, 12e-3, [found[0].waveform])
    for one in found:
        gait = cycles.gait(one.waveform)
        assert gait.speed_m_s == pytest.approx(12e-3, rel=0.02)
        assert impact_of(cycles.model, gait) == one.impact
    chosen = cheapest(found)
    assert chosen is not None
    assert all(chosen.gait.energy_J_per_m <= one.gait.energy_J_per_m for one in found)
    assert cheapest([]) is None
