"""The inverse of what stands between command and force: play and dead zone are crossed, not forgotten."""

import numpy as np
import pytest

from controller.drives import envelope_of
from controller.feedforward import Inverse
from controller.model.control_model import ControlModel, control_model
from models.theta import Theta
from tests.controller.loops import believed, model_of, ticked

PLAY_M, ZONE_A = 1e-3, 0.02


def inverted(model: ControlModel, speed: float) -> float:
    """The command for `speed` where the capsule slides with it, the wall slipping."""
    inverse = Inverse(model, envelope_of(model.drive))
    x = inverse.model.initial(0.0)
    x[model.index("u")], x[model.index("slip")], x[1] = np.sign(speed) * 1e-4, np.sign(speed), speed
    command = inverse.command(x, 0.0, speed, 0.0)
    assert ticked(inverse.model.kernels, x, command, 0.0, 0.0)[1] == pytest.approx(speed, rel=0.05)
    return command


@pytest.mark.parametrize("speed", [2e-3, -2e-3])
def test_the_inverse_crosses_the_play(speed: float) -> None:
    """Half the play beyond the command without it, to whichever side the capsule is to go."""
    loose = control_model(believed(), Theta.of({("carriage_backlash", "play_m"): PLAY_M}), 1e-3)
    ahead = inverted(loose, speed) - inverted(model_of(), speed)
    assert ahead == pytest.approx(np.sign(speed) * 0.5 * PLAY_M, rel=0.05)


@pytest.mark.parametrize("speed", [2e-3, -2e-3])
def test_the_inverse_crosses_the_dead_zone(speed: float) -> None:
    """The zone's width on top of the current that the wall takes, either way."""
    dead = control_model(believed("coil"), Theta.of({("actuator_dead_zone", "zone"): ZONE_A}), 1e-3)
    plain = control_model(believed("coil"), Theta(), 1e-3)
    beyond = inverted(dead, speed) - inverted(plain, speed)
    assert beyond == pytest.approx(np.sign(speed) * ZONE_A, rel=0.05)
