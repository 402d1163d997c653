"""How finer models are told from luck on validation records."""

import numpy as np

from models.identification.search.fitted_model import fewest

BLOCKS = 40
COARSE = 1.06 + 0.05 * np.random.default_rng(1).standard_normal(BLOCKS)
ALIKE = (1.0, 1.0, 1.0)


def test_a_shape_that_mends_every_block_is_taken_though_one_tooth_stays_out() -> None:
    finer = COARSE - 0.03
    finer[7] *= 30
    assert fewest([COARSE, finer], ALIKE) == 1


def test_a_tooth_that_comes_out_right_is_not_worth_a_finer_shape() -> None:
    out = COARSE.copy()
    out[7] *= 30
    assert fewest([out, COARSE], ALIKE) == 0


def test_a_shape_that_fits_the_noise_is_not_taken() -> None:
    luck = COARSE * (1 + 0.02 * np.random.default_rng(2).standard_normal(BLOCKS))
    assert fewest([COARSE, luck], ALIKE) == 0


def test_the_fewest_that_do_as_well_as_the_best_are_taken() -> None:
    assert fewest([COARSE, COARSE - 0.03, COARSE - 0.0301], ALIKE) == 1


def test_blocks_without_any_cost_can_be_compared() -> None:
    assert fewest([np.zeros(BLOCKS), np.zeros(BLOCKS)], ALIKE) == 0


def test_a_shape_that_mends_every_block_alike_is_taken() -> None:
    assert fewest([10 * COARSE, COARSE], ALIKE) == 1


def test_a_shape_that_the_training_records_tell_need_not_stand_out_on_validation_records() -> None:
    uneven = COARSE * np.where(np.arange(BLOCKS) % 2, 0.92, 1.05)
    assert fewest([COARSE, uneven], (1.0, 0.999)) == 0
    assert fewest([COARSE, uneven], (1.0, 0.8)) == 1
