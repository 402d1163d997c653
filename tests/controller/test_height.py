"""The height of a magnet: as high as the pull allows, as low as the tissue bears."""

import tomllib
from typing import Any

import pytest

from controller.height import RESERVE, choose_height, values_at
from controller.model.control_model import control_model
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig, at_height
from tests.rig_texts import GUT


def rig(**further: Any) -> Rig:
    pair = {"outer_moment_A_m2": 420.0, "inner_moment_A_m2": 1.0, "height_m": 0.13}
    return parse_rig({**tomllib.loads(GUT), "rig": {"kind": "magnetic", "magnet": {**pair, **further}}})


def test_a_height_that_is_no_command_is_left_alone() -> None:
    assert choose_height(rig(), {}, 1e-3) is None


def test_the_greatest_height_that_pulls_enough_is_taken() -> None:
    believed = rig(height_range_m=[0.08, 0.3], pressing_limit_N=10.0)
    slow, fast = (choose_height(believed, {}, speed) for speed in (1e-3, 20e-3))
    assert slow is not None
    assert fast is not None
    for one in (slow, fast):
        assert RESERVE <= one.pull_N / one.friction_N < 1.1 * RESERVE
    assert fast.height_m < slow.height_m
    assert fast.pressing_N > slow.pressing_N
    strong = choose_height(believed, {"magnet_stiffness_N_per_m": 40.0}, 1e-3)
    assert strong is not None
    assert strong.height_m > slow.height_m


def test_the_force_on_the_tissue_goes_before_the_pull() -> None:
    held = choose_height(rig(height_range_m=[0.08, 0.3], pressing_limit_N=0.25), {}, 1e-3)
    assert held is not None
    assert 0.22 < held.pressing_N <= 0.25
    assert held.pull_N < RESERVE * held.friction_N
    with pytest.raises(ValueError, match=r"presses with at most pressing_limit_N = 0.1 N; got 0.8.* N at 0.13 m"):
        choose_height(rig(height_range_m=[0.08, 0.13], pressing_limit_N=0.1), {}, 1e-3)


def test_a_model_is_the_same_magnets_at_another_height() -> None:
    believed = rig()
    lifted = at_height(believed, 0.2)
    again = rig(height_m=0.2)
    assert lifted.magnet is not None
    assert again.magnet is not None
    assert lifted.magnet.magnet_stiffness_N_per_m == pytest.approx(again.magnet.magnet_stiffness_N_per_m)
    found = {"magnet_stiffness_N_per_m": 15.0, "friction_coefficient": 0.09}
    model = control_model(lifted, values_at(believed, found, 0.2), 2e-3)
    assert model.drive.gap_limit_m == pytest.approx(0.3893 * 0.2, rel=1e-3)
    assert model.force_per_command == pytest.approx(15.0 * (0.13 / 0.2) ** 5)
