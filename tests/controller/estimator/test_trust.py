"""A model is trusted as far as it predicted records that it had not seen."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.drives import DRIVES, envelope_of
from controller.estimator.base import trusting
from controller.estimator.particle_filter import ParticleEstimator
from controller.model.control_model import ControlModel, control_model, mean_friction, proved_off
from controller.mpc.mpc import MPC
from controller.registry import LATE_SLIP, build
from models.identification.model import HELD_OUT
from plant.anatomy import Anatomy, random_anatomy
from plant.drives import TrueMagnet
from plant.rig import Truth
from tests.controller.estimator.test_particle_filter import errors
from tests.controller.loops import believed, model_of

MODEL = model_of().sharp
WALKS = ("force_wander_N", "force_std_N", "level_wander", "brisk_level_wander", "level_std", "fitted_level_std")


def proved(error_m: float, kind: str = "magnetic") -> ControlModel:
    """A nominal model that missed held-out records by `error_m`."""
    return control_model(believed(kind), {HELD_OUT: error_m}, 1e-3)


@given(st.floats(0, 1e9), st.floats(0, 1e9))
def test_nothing_is_believed_to_wander_more_for_it_and_less_behind_a_better_model(one: float, other: float) -> None:
    better, worse = (trusting(replace(MODEL, held_out_error=e)) for e in sorted((one, other)))
    for name in WALKS:
        assert 0 < getattr(better, name) <= getattr(worse, name) <= getattr(DRIVES["magnetic"].noise, name)


def test_a_force_shows_as_a_position_over_the_magnets_stiffness() -> None:
    """The capsule hangs behind its carriage by F/k: a position off by e is a force off by e k, a share e k/F of
    friction.
    """
    assert proved_off(proved(8e-6)) == pytest.approx(8e-6 * 25.0)
    noise = trusting(proved(8e-6))
    assert noise.force_wander_N == pytest.approx(2e-4)
    assert noise.level_wander == pytest.approx(2e-4 / mean_friction(MODEL)) == noise.brisk_level_wander


def test_what_was_not_held_against_anything_and_what_has_no_magnet_is_believed_as_ever() -> None:
    assert trusting(MODEL) == DRIVES["magnetic"].noise
    assert trusting(proved(1e-6, "coil")) == DRIVES["coil"].noise
    assert trusting(proved(1e-3)).brisk_level_wander == DRIVES["magnetic"].noise.brisk_level_wander


def test_an_mpc_expects_slip_less_late_behind_a_model_that_proved_right() -> None:
    late = []
    for model in (MODEL, proved(1e-3), proved(5e-6)):
        mpc = build("mpc", model, envelope_of(model.drive))[0]
        assert isinstance(mpc, MPC)
        late.append(mpc.horizon.late_slip)
    assert late[0] == late[1] == LATE_SLIP
    assert 0 < late[2] < 0.1


def test_a_model_that_proved_right_knows_more_where_it_is_right_and_is_not_lost_where_it_is_not() -> None:
    """Estimated positions behind a carriage: on the rig that the model is of, and in guts that it knows nothing of."""

    def rms(model: ControlModel, gut: bool) -> float:
        found = []
        for seed in range(210, 213):
            truth = Truth(TrueMagnet(25.0), anatomy=random_anatomy(seed) if gut else Anatomy())
            found.append(errors(ParticleEstimator, truth, seed, model=model)[2000:])
        return float(np.sqrt(np.mean(np.square(found))))

    right = replace(MODEL, held_out_error=5e-6)
    assert rms(right, gut=False) < 0.9 * rms(MODEL, gut=False)
    assert rms(right, gut=True) < 1.5 * rms(MODEL, gut=True)
