"""Another maker's carriage from full speed on, once its controller is lost: it goes on, and no further than its table
states.
"""

import pytest

from tests.bench.bench_stops import stated, worst
from tests.hil.drives.maker_desk import LIMITS
from tests.hil.ticks import TICK

SPEED = LIMITS.carriage_speed_m_s


@pytest.mark.parametrize(("drive", "slows_m_s2", "told_m"), [("cia402", 25.0, 0.0025), ("odrive", 5.0, 0.0025)])
def test_the_way_to_rest_without_a_controller(drive: str, slows_m_s2: float, told_m: float) -> None:
    """The last command goes on until the drive's own watchdog ends it; a stop that is told is braked at 25 m/s2."""
    if drive == "cia402":
        pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    lost, most = worst(drive, SPEED, 3), stated(drive, SPEED)
    assert lost.way_m <= most.way_m + SPEED * TICK
    assert lost.time_s <= most.time_s + TICK
    assert lost.way_m >= 0.4 * SPEED**2 / (2 * slows_m_s2) + SPEED * TICK
    assert worst(drive, SPEED, 3, told=True).way_m <= told_m
