"""What each loop is tuned by: gains of the PID, correction, filter noise, monitor, horizon and weights of the MPC."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

from models.parameter import Name
from models.theta import bare

_SURPRISE: Final = 0.7
"""Of the mean normalised difference, three standard deviations of its noise, beyond which something pushes."""
_ASTRAY: Final = 1.5  # of the same, more than six: the model goes another way than the capsule
_RECENT: Final = 0.1  # share of the newest position in that mean
TOLD_S: Final = 0.4
"""The greatest age in s that a localiser can tell."""
# A, m and m/s by which the states of a drive wander
_DRIVE_SPREADS: Mapping[str, float] = {"current_A": 0.2, "stretch_m": 1e-4, "rate_m_s": 1e-2}


def check_numbers(record: Any, word: str, but: str = "", positive: bool = False, finite: bool = True) -> None:
    """ValueError unless the fields of `record`, `but` for one, are 0 or more, or `positive`, and `finite`."""
    must = "a positive number" if positive else "zero or more"
    for name in (f.name for f in fields(record) if f.name != but):
        value = getattr(record, name)
        if not value >= 0 or (positive and value == 0) or (finite and value == math.inf):
            raise ValueError(f"{word} {name} must be {must}; got {value!r}")


@dataclass(frozen=True)
class PidGains:
    """`F = k_p (r - x) + k_i int (r - x) dt + k_d (r' - v)` in N/m, N/(m s), N s/m; the integral is held within
    `windup_N`. `jerkiness`, in m/s per root s, is that of the `KinematicFilter` that it sees through, nan
    where it sees what the friction-aware estimator believes.
    """

    k_p: float = 0.0
    k_i: float = 0.0
    k_d: float = 0.0
    windup_N: float = 0.15
    jerkiness: float = math.nan

    def __post_init__(self) -> None:
        check_numbers(self, "PID gain", but="jerkiness")


@dataclass(frozen=True)
class Correction:
    """How errors are taken back: the speed asked for is `r' + pace_1_s (r - x)`, corrected by at most `most_m_s`. While
    the reference moves, a capsule ahead by less than `noise_m` waits for it at the most, so that noise does not turn
    friction round. At rest errors up to `slack_m` are left alone, so that a held capsule does not hunt; beyond it the
    capsule is brought back to half of that. Within `reach_s` the inverse gets to the speed: a coil's current needs some
    ticks, a lagging drive most of its time constant.
    """

    pace_1_s: float = 20.0
    noise_m: float = 1.6e-3
    most_m_s: float = 10e-3
    slack_m: float = 0.4e-3
    rest_m_s: float = 2e-5
    reach_s: float = 1e-3

    def __post_init__(self) -> None:
        check_numbers(self, "loop")


@dataclass(frozen=True)
class FilterNoise:
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
    than `latest_s` is not used. Both are `Limits.age_s` of the rig (`up_to`).
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
        check_numbers(self, "noise", but="drive_wander", positive=True)

    def up_to(self, age_s: float) -> FilterNoise:
        """The same for positions as old as a command may rest on (`Limits.age_s`), at most `TOLD_S`."""
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


@dataclass(frozen=True)
class Expected:
    """Of seconds in which the capsule moved by `least_m` or more: `miss_m` is the standard deviation of the forecast's
    miss beside what begin and end are uncertain by, `innovation` that of the mean standardised innovation, `ahead`
    that of `Second.ahead`, `lacking` that of the force that the model lacks, as a share of its mean friction. `alarm`
    is the evidence of forecast, innovations and time that raises an alarm, `drift` that of the drift.

    Evidence is a logarithm of a likelihood ratio: with scales that are not too small and independent seconds, false
    alarms of one sum are e^alarm seconds of motion apart or more (Lorden 1971), 45 h with 12. The force that is
    lacking is alike over several seconds in an uneven gut, so `lacking` and `drift` stand for that: in 40 h along 80
    guts from 100 on (level and noise alone, without the loop) the sum stayed below 12.
    """

    least_m: float = 0.2e-3
    miss_m: float = 0.6e-3
    innovation: float = 0.12
    ahead: float = 1.4
    lacking: float = 0.09
    alarm: float = 14.0
    drift: float = 20.0


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
