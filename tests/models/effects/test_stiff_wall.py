"""A wall that is stiffer at small drags: where it slips, and how fast it draws back."""

import numpy as np
import pytest

from models.assembly.model import assemble
from models.drives.pull import Pull
from models.effects.effect import Signals
from models.effects.wall import SmallStrainStiffening
from models.laws.geometry import Capsule, Tissue
from models.surfaces.gut import Wall
from models.theta import Theta
from tests.models.running import run

DT, SPEED = 1e-4, 2e-3
VALUES = {"excess": 2.4, "scale_m": 1.2e-4, "tail": 0.6}
WALL = Wall.around(Capsule(), Tissue())


def test_it_slips_where_its_own_tension_reaches_the_slip_limit_and_draws_back_from_there_in_the_recovery_time() -> None:
    """`T(u_c) g(u_c) = f_c(v)`, then `u' = -u_c/t_r`, u_c held through the slip whatever u is by then."""
    model = assemble(WALL, Pull(), [SmallStrainStiffening])
    t = DT * np.arange(12000)
    values = Theta().with_(SmallStrainStiffening.id, VALUES)
    u = run(model, SPEED * t, DT, values=values, watch="u")
    p = {"hoop_stress_factor": 1.0, "friction_coefficient": Tissue().friction_coefficient}
    _, onset = WALL.hold(SPEED, p)
    drags = np.linspace(0, 1e-3, 200_001)
    stiff = SmallStrainStiffening().stiffening(Signals(drag=drags), VALUES, {})
    u_c = float(np.interp(float(onset), WALL.tension(drags) * stiff, drags))
    assert u.max() == pytest.approx(u_c, rel=2e-3)
    falling = np.diff(u)[np.diff(u) < 0] / DT
    assert np.median(falling) == pytest.approx(-u_c / Tissue().recovery_time_s, rel=1e-3)
    assert np.ptp(np.quantile(falling, (0.05, 0.95))) < 1e-3 * abs(np.median(falling))
