"""Resistance whose level goes by speed or place: friction within a step, and what of the slip limit follows the
level.
"""

import numpy as np
import pytest

from models.assembly.model import assemble
from models.drives.magnetic import Magnetic
from models.effects import CATALOGUE
from models.effects.effect import Effect, Signals
from models.effects.friction import DirectionalAsymmetry
from models.effects.refinements import LevelAtCreep, LevelAtOnset
from models.laws.geometry import GRAVITY, Capsule, Tissue
from models.surfaces.gut import Wall
from models.theta import Theta
from tests.models.running import run

DT = 2e-3
WALL = Wall.around(Capsule(), Tissue())
CREEP = Theta.of(
    {
        ("directional_asymmetry", "asymmetry"): -0.29,
        ("level_at_creep", "odd"): 0.28,
        ("level_at_creep", "even"): 0.09,
    }
)


def test_friction_that_rises_steeply_with_speed_is_that_of_the_steps_own_speed() -> None:
    """A level that comes with 0.2 mm/s makes rates of some 8,000 1/s of 4 g: steps of 0.25 ms must tell what steps of 5
    us do.
    """
    model = assemble(WALL, Magnetic(), [DirectionalAsymmetry, LevelAtCreep])
    t = DT * np.arange(5000)
    carriage = 8e-3 * np.sin(2 * np.pi * 0.2 * t) + 2e-3 * np.sin(2 * np.pi * 0.71 * t)
    coarse, fine = (run(model, carriage, DT, substeps, CREEP) for substeps in (8, 400))
    assert np.sqrt(np.mean((coarse - fine) ** 2)) < 5e-6


@pytest.mark.parametrize("effect", [e for e in CATALOGUE.values() if e.answers("level")], ids=lambda e: e.id)
def test_an_effect_says_whether_its_level_goes_by_the_speed(effect: type[Effect]) -> None:
    refined = CATALOGUE[effect.of].parameters() if effect.of else ()
    numbers = {p.name: p.value or 0.01 * k for k, p in enumerate((*refined, *effect.parameters()), start=1)}
    z = dict.fromkeys(effect.states, 0.3)
    levels = [
        effect().level(Signals(t=5.0, x=0.01, v=v, direction=1.0, travelled=0.1), numbers, z)
        for v in (1e-4, 1e-3, 1e-2)
    ]
    assert (float(np.ptp(np.array(levels, dtype=float))) > 0) == effect.by_speed


@pytest.mark.parametrize(("kept", "spared"), [(0.0, 0.0), (0.4, 0.0), (1.0, 0.3), (1.0, 1.0), (0.2, -0.3), (0.0, -1.0)])
def test_a_changed_resistance_leaves_the_shares_that_it_spares(kept: float, spared: float) -> None:
    """Paper V Eq. 8 and 11: `F_e` and `f_c = mu (m g + N_p)`, each with its own share of a level l."""
    mu, level = Tissue().friction_coefficient, 1.7
    own = LevelAtOnset().shared({"kept": kept, "spared": spared}, (level, level, level))
    p = {"hoop_stress_factor": 1.1, "friction_coefficient": mu}
    resistance, limit = WALL.hold(5e-3, p, levels=own)
    plain_resistance, plain = WALL.hold(5e-3, p)
    weight = mu * Capsule().mass_kg * GRAVITY
    nose, pressed = (1 + (1 - max(-spared, 0)) * 0.7), (1 + (1 - max(spared, 0)) * 0.7)
    assert resistance == pytest.approx(nose * plain_resistance)
    assert limit == pytest.approx(weight * (1 + (1 - kept) * 0.7) + (plain - weight) * pressed)
    if kept == spared == 1.0:
        assert limit == pytest.approx(plain)
    if spared == -1.0:
        assert resistance == pytest.approx(plain_resistance)
