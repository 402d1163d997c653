"""The height of the carriage's magnet, a command beside its position: as high as the wanted pull allows."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from models.parameter import Name
from models.rigs.kinds import drive_of, surface_of
from models.rigs.rig import Rig, at_height
from models.theta import Theta

RESERVE: Final = 2.0
"""Ratio of the magnet's greatest pull to the friction at the wanted speed (choice: folds and narrow segments)."""
STIFFNESS: Final = "magnet_stiffness_N_per_m"
_HEIGHTS: Final = 61  # heights that the command is chosen from


@dataclass(frozen=True)
class Height:
    """At a height in m: the greatest pull, the friction it meets, the force that presses on the tissue, in N."""

    height_m: float
    pull_N: float
    friction_N: float
    pressing_N: float


def choose_height(rig: Rig, values: Mapping[Name, float], speed_m_s: float) -> Height | None:
    """The greatest, so gentlest, height within `[rig.magnet] height_range_m` at which the magnet pulls `RESERVE` times
    the friction at `speed_m_s`, its own attraction included. None for a rig without a height command. Heights that
    press with more than `pressing_limit_N` are excluded; if no other pulls enough, the lowest remaining one. `values`
    are a stage of a model file. Raises ValueError if every height presses too much.
    """
    magnets = rig.magnets
    if magnets is None or magnets.height_range_m is None or magnets.pressing_limit_N is None:
        return None
    low, high = magnets.height_range_m
    heights = [_at(rig, values, float(h), speed_m_s) for h in np.geomspace(high, low, _HEIGHTS)]
    gentle = [one for one in heights if one.pressing_N <= magnets.pressing_limit_N]
    if not gentle:
        raise ValueError(
            f"[rig.magnet] height_range_m must reach a height at which the magnet presses with at most pressing_limit_N"
            f" = {magnets.pressing_limit_N:g} N; got {heights[0].pressing_N:.3g} N at {high:g} m"
        )
    return next((one for one in gentle if one.pull_N >= RESERVE * one.friction_N), gentle[-1])


def values_at(rig: Rig, values: Mapping[Name, float], height_m: float) -> Theta:
    """A model's `values`, identified at the rig file's height, converted to `height_m`."""
    if rig.magnets is None or STIFFNESS not in values:
        return Theta.of(values)
    return Theta.of(values) | {STIFFNESS: values[STIFFNESS] * (rig.magnets.height_m / height_m) ** 5}


def _at(rig: Rig, values: Mapping[Name, float], height_m: float, speed_m_s: float) -> Height:
    lifted = at_height(rig, height_m)
    drive, surface = drive_of(lifted), surface_of(lifted)
    declared = Theta.declared((*surface.parameters(), *drive.parameters()))
    p = (declared | values_at(rig, values, height_m)).base
    pressing = float(drive.pressing(0.0, 0.0, p))
    friction, onset = surface.hold(speed_m_s, p, pressing=pressing)
    most = float(drive.force(0.0, 0.0, drive.gap_limit_m, p))
    return Height(height_m, most, float(friction + onset), pressing)
