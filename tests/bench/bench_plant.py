"""How much faster than real time the plant runs at its 20 us step; off by default, `pytest -s
tests/bench/bench_plant.py`.
"""

import time

import numpy as np
import pytest

from models.laws.geometry import Capsule
from plant.drives import TrueCoil, TrueMagnet, TruePull, TrueVibro
from plant.experiments.profile import Wander, WholeRuns, pulse_width
from plant.rig import STEP_S, Plant, TruePlate, Truth
from plant.tables import Floats

DURATION_S = 10.0
FAST_ENOUGH = 100.0


def cases() -> dict[str, tuple[Truth, Floats]]:
    rng = np.random.default_rng(0)
    runs = WholeRuns().values(DURATION_S, STEP_S, rng)[: round(DURATION_S / STEP_S) + 1]
    wander = Wander().values(DURATION_S, STEP_S, rng)
    t = STEP_S * np.arange(round(DURATION_S / STEP_S) + 1)
    vibro = TrueVibro(1.8e-3, 62.0, 0.0156, 0.12, front_gap_m=1.6e-3, front_stiffness_N_per_m=27.9e3)
    return {
        "pull": (Truth(TruePull()), runs),
        "pull, elastic link": (Truth(TruePull(100.0)), runs),
        "magnetic": (Truth(TrueMagnet()), wander),
        "magnetic, hidden folds": (Truth(TrueMagnet(), hidden={"fold_periodic": {}}), wander),
        "coil": (Truth(TrueCoil()), 5.0 * np.sin(6.0 * t)),
        "vibro on the gut": (Truth(vibro), 0.12 * pulse_width(0.04, 0.3, DURATION_S, STEP_S)),
        "vibro on a plate": (
            Truth(TrueVibro(), capsule=Capsule(mass_kg=0.193), surface=TruePlate(0.29)),
            1.25 * pulse_width(0.06, 0.3, DURATION_S, STEP_S),
        ),
    }


@pytest.mark.parametrize("name", list(cases()))
def test_the_plant_is_a_hundred_times_faster_than_real_time(name: str) -> None:
    rig, drive = cases()[name]
    plant = Plant(rig)
    plant.advance(drive[:3])
    best = float("inf")
    for _ in range(5):
        start = time.process_time()
        plant.advance(drive, 100)
        best = min(best, time.process_time() - start)
    ratio = STEP_S * (drive.size - 1) / best
    print(f"{name}: {ratio:.0f} x real time, {1e9 * best / (drive.size - 1):.0f} ns a step")
    assert ratio >= FAST_ENOUGH
