"""What the filter assumes about the noise of a model, as far as that is trusted."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from controller.drives import driven_of
from controller.model.control_model import ControlModel
from controller.model.friction import AT_FIRST, level_off, proved_off
from controller.tuned import FilterNoise

START_STD: Final[Mapping[str, float]] = {"v": 1e-3, "u": 1e-4}  # m/s and m, before anything was measured


def trusting(model: ControlModel) -> FilterNoise:
    """The noise of its drive for `model`, which is trusted as far as it predicted records that it had not seen.

    Where its forces proved to be off by f (`proved_off`), the force wanders by no more than f a root second and the
    level by no more than f over the mean friction, and both may be `AT_FIRST` times as far off at the start.
    """
    noise, force, level = driven_of(model.drive).noise, proved_off(model), level_off(model)
    if force is None or level is None:
        return noise
    return replace(
        noise,
        force_wander_N=min(noise.force_wander_N, force),
        force_std_N=min(noise.force_std_N, AT_FIRST * force),
        level_wander=min(noise.level_wander, level),
        brisk_level_wander=min(noise.brisk_level_wander, level),
        level_std=min(noise.level_std, AT_FIRST * level),
        fitted_level_std=min(noise.fitted_level_std, AT_FIRST * level),
    )
