"""What an MPC is told beside its drive's limits: horizon and weights."""

import math
from dataclasses import dataclass

from controller.tuned import check_numbers


@dataclass(frozen=True)
class Horizon:
    """`stages` of `stage_s` each, integrated in `substeps`; at most `iterations` SQP steps, none begun that would end
    later than `deadline_s` after the plan's begin (inf: the same on every machine).

    A capsule within `rest_m` of a reference that stands still, or within three standard deviations of the estimate up
    to three times that, is left alone until it is twice as far: smooth friction creeps where the real one holds, and a
    controller that believes it, or follows the noise, would hunt.

    `late_slip`: by what share a plan takes the slip limit for higher. One that eases off ahead of a slip that comes a
    little late leaves the capsule stuck at the threshold; one that keeps pulling loses a few milliseconds.

    A plan that its last step no longer improved is followed for up to `hold_s` while the estimate stays within `hold_m`
    of its path and its rates change within a tick's acceleration: a plan for each tick reacts to the noise of one
    reading several times.
    """

    stages: int = 30
    stage_s: float = 5e-3
    substeps: int = 2
    iterations: int = 3
    deadline_s: float = math.inf
    rest_m: float = 1e-4
    late_slip: float = 0.0
    hold_s: float = 0.0
    hold_m: float = 2e-5

    def __post_init__(self) -> None:
        whole = (("stages", 2, 200), ("substeps", 1, 100), ("iterations", 1, 100), ("late_slip", 0, 1))
        for name, low, high in whole:
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} must lie in [{low}, {high}]; got {getattr(self, name):g}")
        if not 0 <= self.hold_s <= 0.5 * self.stages * self.stage_s:
            raise ValueError(
                f"hold_s must lie within half the horizon of {self.stages * self.stage_s:g} s; got {self.hold_s:g}"
            )
        for name, most in (("stage_s", 1.0), ("rest_m", 1.0), ("hold_m", 1.0), ("deadline_s", math.inf)):
            if not 0 < getattr(self, name) <= most:
                raise ValueError(f"{name} must lie above 0, up to {most:g}; got {getattr(self, name):g}")


@dataclass(frozen=True)
class Weights:
    """Deviations that cost as much as each other, and what a soft bound costs. The cost is `1/2 sum_k ((x -
    r)/position_m)^2 + ((v - r')/speed_m_s)^2 + ((c' - c_r')/rate)^2 + ((c'_k - c'_{k-1})/jump)^2`, the last position
    counted `final` times; `rate` and `jump` are given as the rate of the drive's force in N/s. A soft bound exceeded by
    a share e of itself at worst costs `weight (e + 5 e^2)`.
    """

    position_m: float = 1e-4
    speed_m_s: float = 2e-2
    rate_N_s: float = 4.0
    jump_N_s: float = 8.0
    final: float = 5.0
    gap: float = 2e4
    speed: float = 5e3
    force: float = 5e3

    def __post_init__(self) -> None:
        check_numbers(self, "weight", positive=True)
