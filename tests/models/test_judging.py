"""How finer models are told from luck on validation records."""

from __future__ import annotations

import numpy as np

from models.identification.judging import fewest

BLOCKS = 40
COARSE = 1.06 + 0.05 * np.random.default_rng(1).standard_normal(BLOCKS)


def test_a_shape_that_mends_every_block_is_taken_though_one_tooth_stays_out() -> None:
    finer = COARSE - 0.03
    finer[7] *= 30
    assert fewest([COARSE, finer]) == 1


def test_a_tooth_that_comes_out_right_is_not_worth_a_finer_shape() -> None:
    out = COARSE.copy()
    out[7] *= 30
    assert fewest([out, COARSE]) == 0


def test_a_shape_that_fits_the_noise_is_not_taken() -> None:
    luck = COARSE * (1 + 0.02 * np.random.default_rng(2).standard_normal(BLOCKS))
    assert fewest([COARSE, luck]) == 0


def test_the_fewest_that_do_as_well_as_the_best_are_taken() -> None:
    assert fewest([COARSE, COARSE - 0.03, COARSE - 0.0301]) == 1


def test_blocks_without_any_cost_can_be_compared() -> None:
    assert fewest([np.zeros(BLOCKS), np.zeros(BLOCKS)]) == 0


def test_a_shape_that_mends_every_block_alike_is_taken() -> None:
    assert fewest([10 * COARSE, COARSE]) == 1
