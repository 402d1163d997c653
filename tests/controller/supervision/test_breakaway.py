"""A capsule that a narrow place lets go stays within its speed limit, however late its readings come."""

from collections import deque

import numpy as np
import pytest

from controller.limits import Envelope, Limits
from controller.supervision.breakaway import Breakaway, Resistance
from controller.supervision.contradiction import Contradiction

COIL = Envelope(-1.0, 1.0, Limits(), 1200.0, sense=-1.0)
FRICTION_A, GAIN, TICK_S = 0.2, 125.0, 1e-3


def viscous(fast: float) -> Resistance:
    """0.2 A at rest, `fast` times that at the speed limit."""
    return Resistance(tuple(np.linspace(FRICTION_A, fast * FRICTION_A, 31)), COIL.limits.speed_m_s, GAIN)


@pytest.mark.parametrize("late_s", [0.002, 0.016, 0.05])
@pytest.mark.parametrize("held", [1.1, 1.8, 2.5])
@pytest.mark.parametrize("fast", [1.0, 3.0])
def test_a_capsule_that_comes_loose_keeps_the_limit_whatever_is_asked(held: float, late_s: float, fast: float) -> None:
    """`held` frictions hold a capsule of 4 g and let it go; a controller asks for all it may. The gut's friction is a
    tenth less than the model's.
    """
    resistance = viscous(fast)
    watch, rng = Contradiction(COIL, 1e-4, resistance), np.random.default_rng(0)
    x, v, fastest, loose, coming = 0.0, 0.0, 0.0, False, deque[tuple[float, float]]()
    for k in range(2000):
        now, command = k * TICK_S, max(watch.breakaway.room[0], -1.0)
        if k % 10 == 0:
            coming.append((now, x + 1e-4 * rng.standard_normal()))
        loose = loose or abs(command) > held * FRICTION_A
        v = max(v + TICK_S * GAIN * (abs(command) - 0.9 * resistance.at(v)), 0.0) if loose else 0.0
        x, fastest = x + v * TICK_S, max(fastest, v)
        watch.breakaway.sent(now + TICK_S, command, TICK_S)
        while coming and coming[0][0] + late_s <= now:
            watch.saw(coming[0][1], command, 0.0, coming[0][0])
            coming.popleft()
    assert loose
    assert x > 1e-3
    assert fastest < COIL.limits.speed_m_s


def test_a_push_that_friction_at_half_the_limit_holds_is_not_cut() -> None:
    loose = Breakaway(viscous(3.0))
    for k in range(100):
        loose.sent(k * TICK_S, 1.5 * FRICTION_A, TICK_S)
    assert loose.room[1] > 1.5 * FRICTION_A


def test_a_push_against_the_slip_is_not_cut_for_it() -> None:
    loose = Breakaway(viscous(1.0))
    loose.sent(0.0, 0.0, TICK_S)
    loose.saw(-0.02, 0.0, 0.3)
    assert loose.room[1] < 0.5 * FRICTION_A
    assert loose.room[0] < -2 * FRICTION_A


def test_other_drives_are_not_limited() -> None:
    assert Breakaway(Resistance()).room == (-np.inf, np.inf)
