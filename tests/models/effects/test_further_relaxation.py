"""Two Maxwell branches side by side: after a stop the force relaxes as the sum of two exponentials."""

import numpy as np
import pytest

from models.assembly.model import assemble
from models.drives.pull import Pull
from models.effects.force import StressRelaxation
from models.effects.refinements import FurtherRelaxation
from models.laws.geometry import Capsule, Tissue
from models.surfaces.gut import Wall
from models.theta import Theta
from tests.models.running import run

DT, SPEED, STOPS = 1e-3, 4e-3, 1.5
TIME = DT * np.arange(6000)
WALL = Wall.around(Capsule(), Tissue())
BRANCHES = {"stress_relaxation": (12.0, 2.0), "further_relaxation": (8.0, 0.3)}


def test_a_held_force_relaxes_as_the_sum_of_two_exponentials() -> None:
    """A ramp of speed v for T charges each branch to `k v tau (1 - exp(-T/tau))`, of which a hold leaves the share
    `exp(-t/tau)`.
    """
    values = Theta.of(
        {
            (name, key): value
            for name, pair in BRANCHES.items()
            for key, value in zip(("stiffness_N_per_m", "time_s"), pair, strict=True)
        }
    )
    values |= {(name, "slip_per_m"): 0.0 for name in BRANCHES}
    path = SPEED * np.minimum(TIME, STOPS)
    base = run(assemble(WALL, Pull(), []), path, DT)
    both = run(assemble(WALL, Pull(), [StressRelaxation, FurtherRelaxation]), path, DT, values=values)
    held = TIME - STOPS
    late = held > 0.05
    expected = sum(
        k * SPEED * tau * (1 - np.exp(-STOPS / tau)) * np.exp(-held[late] / tau) for k, tau in BRANCHES.values()
    )
    assert (both - base)[late] == pytest.approx(expected, rel=5e-3, abs=1e-5)


@pytest.mark.parametrize("speed", [1e-3, 4e-3])
def test_a_branch_that_thins_saturates_with_speed_and_relaxes_as_before(speed: float) -> None:
    """A long ramp charges it to `k v tau/(1 + b |v|)`, and a hold leaves the share `exp(-t/tau)` of that."""
    k, tau, thinning = 12.0, 0.2, 400.0
    values = Theta.of(
        {
            ("stress_relaxation", "stiffness_N_per_m"): k,
            ("stress_relaxation", "time_s"): tau,
            ("stress_relaxation", "thinning_s_per_m"): thinning,
        }
    )
    path = speed * np.minimum(TIME, STOPS)
    base = run(assemble(WALL, Pull(), []), path, DT)
    force = run(assemble(WALL, Pull(), [StressRelaxation]), path, DT, values=values) - base
    held = np.maximum(TIME - STOPS, 0.0)
    late = TIME > STOPS - 0.1
    assert force[late] == pytest.approx(
        k * speed * tau / (1 + thinning * speed) * np.exp(-held[late] / tau), rel=0.01, abs=1e-6
    )
