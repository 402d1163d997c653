"""What the controller is told of a rig: `[belief]` over nominal values."""

import pytest

from hil.app.scenario.scenario import read_belief


def test_belief_may_give_the_lumen_in_place_of_the_nominal_angle() -> None:
    belief = read_belief({"tissue": {"lumen_diameter_m": 9e-3, "regime": "blend"}}, "magnetic", "gut")
    assert belief.tissue.contact_angle_deg == pytest.approx(46.2, abs=0.02)
    assert belief.tissue.regime == "blend"
    assert read_belief({}, "magnetic", "gut").tissue.contact_angle_deg == 60.0
