"""What each loop is tuned by: gains of the PID, correction, filter noise, monitor, horizon and weights of the MPC."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

from models.parameter import Name
from models.theta import bare

_SURPRISE: Final = 0.7  # mean normalised innovation, three of its standard deviations, beyond which a push is assumed
_ASTRAY: Final = 1.5  # the same, more than six: model and capsule move apart
_RECENT: Final = 0.1  # share of the newest position in that mean
OLDEST_S: Final = 0.4  # greatest age in s that a localiser can state
# A, m and m/s by which the states of a drive wander
_DRIVE_SPREADS: Mapping[str, float] = {"current_A": 0.2, "stretch_m": 1e-4, "rate_m_s": 1e-2}


def check_numbers(record: Any, word: str, but: str = "", positive: bool = False, finite: bool = True) -> None:
    """ValueError unless the fields of `record`, except `but`, are 0 or more, or `positive`, and `finite`."""
    must = "a positive number" if positive else "zero or more"
    for name in (f.name for f in fields(record) if f.name != but):
        value = getattr(record, name)
        if not value >= 0 or (positive and value == 0) or (finite and value == math.inf):
            raise ValueError(f"{word} {name} must be {must}; got {value!r}")


@dataclass(frozen=True)
class PidGains:
    """`F = k_p (r - x) + k_i int (r - x) dt + k_d (r' - v)` in N/m, N/(m s), N s/m, the integral limited to `windup_N`.
    `jerkiness` in m/s per root s is that of the `KinematicFilter` before it; nan: it uses the friction-aware estimate.
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
    """Position feedback: the demanded speed is `r' + gain_1_s (r - x)`, the correction at most `most_m_s`. While the
    reference moves, a capsule ahead by less than `noise_m` at most waits, so noise does not reverse friction. At rest
    errors up to `slack_m` are left alone, so that the loop does not hunt; a larger one is reduced to half of that. The
    inverse reaches the speed within `reach_s`: a coil's current needs some ticks, a lagging drive most of its time
    constant.
    """

    gain_1_s: float = 20.0
    noise_m: float = 1.6e-3
    most_m_s: float = 10e-3
    slack_m: float = 0.4e-3
    rest_m_s: float = 2e-5
    reach_s: float = 1e-3

    def __post_init__(self) -> None:
        check_numbers(self, "loop")


@dataclass(frozen=True)
class FilterNoise:
    """Standard deviations, SI. `*_wander` are random walks over one second; states not named wander by `other_wander`.

    The friction level is a share of the wall's pressure (of the friction coefficient on a plate), the force is what
    friction does not explain. `level_std` (`fitted_level_std` after a fit) and `force_std_N` are their initial
    uncertainty. Half of the particles assume `level_wander`, as in a tube, half `brisk_level_wander`, as in an uneven
    gut. While innovations have one sign, the force wanders by `push_wander_N`: something pushes. While they are far off
    on one side, the position wanders by `slip_wander_m` too.

    A measurement beyond `gate` standard deviations is an outlier. After `slips_in_a_row` outliers the position estimate
    follows, if the capsule may have moved between them at `slip_m_s`; else the estimate restarts after
    `outliers_in_a_row`. The estimate is lost without an accepted position for `age_s`, above `lost_std_m`, and until
    `proof` positions in a row were accepted after a start. Readings older than `latest_s` are not used. Both ages are
    `Limits.age_s` of the rig (`up_to`).
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
        """The same for positions as old as `age_s` (`Limits.age_s`), at most `OLDEST_S`."""
        return replace(self, age_s=age_s, latest_s=min(age_s, OLDEST_S))

    def surprised(self, before: float, size: float) -> float:
        """The running mean of the normalised innovations, updated with `size`."""
        return before + _RECENT * (size - before)

    def walks(self, surprise: float) -> tuple[float, float]:
        """Random walks of force and position at a mean innovation of `surprise`."""
        force = self.push_wander_N if abs(surprise) > _SURPRISE else self.force_wander_N
        return force, self.slip_wander_m if abs(surprise) > _ASTRAY else self.position_wander_m

    def wander(self, state: Name) -> float:
        """Standard deviation of the random walk of the model's `state` over one second."""
        own: dict[Name, float] = {"x": self.position_wander_m, "v": self.speed_wander_m_s, "u": self.wall_wander_m}
        return own.get(state, self.drive_wander.get(bare(state), self.other_wander))


@dataclass(frozen=True)
class Expected:
    """Scatter of seconds in which the capsule moved by `least_m` or more: `miss_m` of the forecast's error beside the
    uncertainty of its ends, `innovation` of the mean standardised innovation, `ahead` of `Second.ahead`, `lacking` of
    the force that the model lacks, as a share of its mean friction. `alarm` is the evidence of forecast, innovations
    and time that raises an alarm, `drift` that of the drift.

    Evidence is a log likelihood ratio. With scales not too small and independent seconds, false alarms of one sum are
    e^alarm seconds of motion apart or more (Lorden 1971), 45 h with 12. In an uneven gut the lacking force is alike
    over several seconds; `lacking` and `drift` account for that: in 40 h along 80 guts from 100 on the sum stayed below
    12.
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
    """`stages` of `stage_s` each, integrated in `substeps`; at most `iterations` SQP steps, none that would end later
    than `deadline_s` after the plan's begin (inf: the same on every machine).

    A capsule within `rest_m` of a resting reference, or within three standard deviations of the estimate up to three
    times that, is left alone until it is twice as far. Smoothed friction creeps where real friction holds, so the loop
    would hunt.

    `late_slip`: share by which a plan takes the slip limit as higher. A plan that eases off before a late slip leaves
    the capsule stuck; one that keeps pulling loses a few milliseconds.

    A plan that its last step did not improve is followed for up to `hold_s`, while the estimate stays within `hold_m`
    of its path and its rates change within a tick's acceleration. A new plan per tick reacts to the noise of one
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
    """Deviations that cost as much as each other, and the cost of soft bounds. The cost is `1/2 sum_k ((x -
    r)/position_m)^2 + ((v - r')/speed_m_s)^2 + ((c' - c_r')/rate)^2 + ((c'_k - c'_{k-1})/jump)^2`, the last position
    weighted by `final`; `rate` and `jump` are given as rates of the drive's force in N/s. A soft bound exceeded by its
    share e costs `weight (e + 5 e^2)`.
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
