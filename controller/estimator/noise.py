"""What the filter assumes about noise, gates and outliers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from controller.model.control_model import ControlModel
from controller.model.friction import AT_FIRST, level_off, proved_off
from models.parameter import Name
from models.theta import bare

Array = NDArray[np.float64]
_SURPRISE: Final = (
    0.7  # of the mean normalised difference, three standard deviations of its noise, beyond which something pushes
)
_ASTRAY: Final = 1.5  # of the same, more than six: the model goes another way than the capsule
_RECENT: Final = 0.1  # share of the newest position in that mean
TOLD_S: Final = 0.4
"""The greatest age in s that a localiser can tell."""
START_STD: Final[Mapping[str, float]] = {"v": 1e-3, "u": 1e-4}
_DRIVE_SPREADS: Mapping[str, float] = {"current_A": 0.2, "stretch_m": 1e-4, "rate_m_s": 1e-2}


@dataclass(frozen=True)
class Noise:
    """Standard deviations, SI. `*_wander` are random walks, a second's worth; what is not named here wanders by
    `other_wander` of 1.

    The friction level is a share of the wall's pressure (of the friction coefficient on a plate), the force what no
    friction explains; `level_std` (`fitted_level_std` of a model that a fit has moved) and `force_std_N` are how far
    they may be off at the start. Half of the particles hold that the level wanders by `level_wander`, as in a tube,
    half by `brisk_level_wander`, as along a gut that changes. The force wanders by `push_wander_N` instead while
    positions come out on one side of what was expected: something pushes. While they are far off on one side the
    position wanders by `slip_wander_m`, too: strokes carry the capsule further, or less far, than believed.

    A measurement further than `gate` standard deviations from what was expected is an outlier. After `slips_in_a_row`
    of them the believed place follows, where the capsule may have gone from one to the next at `slip_m_s`; else
    `outliers_in_a_row` mean that the belief is wrong, not they. The estimate is lost without an accepted position for
    `age_s`, above `lost_std_m`, and until `proof` positions in a row were accepted after a new start. A reading later
    than `latest_s` is not used. Both are `Limits.age_s` of the rig (`Noise.up_to`).
    """

    position_std_m: float = 0.5e-3
    feedback_std: float = 1e-3
    carriage_std_m: float = 2e-5
    position_wander_m: float = 1e-4
    slip_wander_m: float = 1e-4
    speed_wander_m_s: float = 1e-2
    wall_wander_m: float = 5e-5
    force_wander_N: float = 2e-3
    push_wander_N: float = 2e-3
    force_std_N: float = 3e-3
    level_wander: float = 0.01
    brisk_level_wander: float = 0.06
    level_std: float = 0.05
    fitted_level_std: float = 0.05
    other_wander: float = 1e-3
    gate: float = 5.0
    outliers_in_a_row: int = 12
    slips_in_a_row: int = 3
    slip_m_s: float = 0.2
    proof: int = 5
    age_s: float = 0.15
    lost_std_m: float = 2e-3
    latest_s: float = 0.15
    drive_wander: Mapping[str, float] = field(default_factory=lambda: dict(_DRIVE_SPREADS))

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self) if f.name != "drive_wander"):
            if not 0 < getattr(self, name) < math.inf:
                raise ValueError(f"noise {name} must be a positive number; got {getattr(self, name)!r}")

    def up_to(self, age_s: float) -> Noise:
        """The same, with positions taken as old as `Limits.age_s` lets a command rest on: the bus tells no greater age
        than `TOLD_S`.
        """
        return replace(self, age_s=age_s, latest_s=min(age_s, TOLD_S))

    def surprised(self, before: float, size: float) -> float:
        """By how many standard deviations recent positions were off on average, one more of them by `size`."""
        return before + _RECENT * (size - before)

    def walks(self, surprise: float) -> tuple[float, float]:
        """How force and position wander after positions that were off by `surprise` on average."""
        force = self.push_wander_N if abs(surprise) > _SURPRISE else self.force_wander_N
        return force, self.slip_wander_m if abs(surprise) > _ASTRAY else self.position_wander_m

    def wander(self, state: Name) -> float:
        """Standard deviation of the random walk of the model's `state` over a second."""
        own: dict[Name, float] = {"x": self.position_wander_m, "v": self.speed_wander_m_s, "u": self.wall_wander_m}
        return own.get(state, self.drive_wander.get(bare(state), self.other_wander))


_BODY = Noise(
    position_wander_m=3e-5,
    slip_wander_m=1e-3,
    force_wander_N=3e-4,
    push_wander_N=60e-3,
    level_std=0.15,
)
NOISES: Mapping[str, Noise] = MappingProxyType({"magnetic": _BODY, "coil": _BODY, "vibro": Noise(slip_wander_m=4e-3)})
"""By drive where the default does not serve. Of a body's, `push_wander_N` (20, 40, 60 and 100 mN) and `slip_wander_m`
(0.03, 0.1, 1 and 3 mm) erred least over pushes, folds and a narrow place, three seeds from 100 on; straight traverses
lose a little by it, 0.01 mm where a coil's is slow. How far a stroke of an inner mass carries hangs on every parameter:
with the position's common wander a filter that believed four times too far ran ahead until it was lost, eight times in
16 s; of 1 to 8 mm those from 2 on did alike.
"""


def noise_of(drive: str) -> Noise:
    """What the filter assumes for a drive of this name."""
    return NOISES.get(drive, Noise())


def trusting(model: ControlModel) -> Noise:
    """The same for `model`, which is trusted as far as it predicted records that it had not seen.

    Where its forces proved to be off by f (`proved_off`), the force wanders by no more than f a root second and the
    level by no more than f over the mean friction, and both may be `AT_FIRST` times as far off at the start.
    """
    noise, force, level = noise_of(model.drive.name), proved_off(model), level_off(model)
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
