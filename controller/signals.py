"""What passes between sensors, estimator, controller and drive: measurement, estimate, reference, action."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Status = Literal["ok", "late", "failed", "lost", "limited", "stopped"]


@dataclass(frozen=True, slots=True)
class Measurement:
    """One reading: `channel` is a column name of records, `value` SI, true at `stamp_s`."""

    channel: str
    value: float
    stamp_s: float


@dataclass(frozen=True, slots=True)
class Adapted:
    """Parameters (p,) in the model's order as the estimator believes them, and the force along +x that is left."""

    parameters: Array
    disturbance_N: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """What the estimator believes at `time_s`: `state` (n,) in the control model's order, its standard deviations `std`
    (n,), a slowly varying `disturbance_N` along +x that the model lacks; `lost` when it should not be acted on.
    `adapted`, where the estimator learns, says the same with other parameters: `disturbance_N` is what the model's own
    ones lack in the present motion. `innovations` are by how many standard deviations the positions taken in with it
    were off what was expected, signed; `surprise` is that of the newest position, be it taken in or refused, NaN where
    none came.
    """

    time_s: float
    state: Array
    std: Array
    disturbance_N: float = 0.0
    lost: bool = False
    adapted: Adapted | None = None
    innovations: tuple[float, ...] = ()
    surprise: float = math.nan


class Reference(Protocol):
    """Where the capsule shall be."""

    def position(self, t: Array) -> Array:
        """Position in m at the times `t` in s, same shape."""
        ...

    def speed(self, t: Array) -> Array:
        """Speed in m/s at the times `t` in s, same shape."""
        ...


@dataclass(frozen=True, slots=True)
class Action:
    """A controller's answer for one tick: `command` in the drive's unit, how it came about, the path it expects ((k,)
    positions in m or None) and how long each phase took in s; `cut_after` says after how many steps the clock cut a
    plan short (None: it did not).
    """

    command: float
    status: Status = "ok"
    predicted: Array | None = None
    timings: Mapping[str, float] = field(default_factory=dict)
    cut_after: int | None = None


class Controller(Protocol):
    """What every controller is. No method raises; all take bounded time."""

    name: str

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """Begin at `now` in s with `command` in force, without a bump."""
        ...

    def follow(self, command: float, rate: float) -> None:
        """Hear the command in force and its `rate` a second, before each `act`: what limits left of the last answer,
        for those who go on from their own commands. The others need not listen.
        """
        return

    def allow(self, steps: int) -> None:
        """Cut the next plan after so many steps, as the clock did once, for those who plan by a deadline."""
        return

    def calm(self) -> bool:
        """Take errors back at half the pace from here on, as the loop swings; whether this one can."""
        return False

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        """The command for the tick that begins at `now` in s."""
        ...
