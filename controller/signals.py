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
    """Parameters (p,) in the model's order as the estimator has learned them, and the remaining force along +x."""

    parameters: Array
    disturbance_N: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """State estimate at `time_s`: `state` (n,) in the control model's order, standard deviations `std` (n,), and
    `disturbance_N`, a slow force along +x that the model lacks. `lost`: not to be acted on.

    `adapted`, from an estimator that learns, is the same estimate with learned parameters; `disturbance_N` is then what
    the model's own parameters lack in the present motion. `innovations`: normalised, signed innovations of the accepted
    positions. `surprise`: that of the newest position, accepted or refused; NaN without one.
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
    """The wanted position of the capsule."""

    def position(self, t: Array) -> Array:
        """Position in m at the times `t` in s, same shape."""
        ...

    def speed(self, t: Array) -> Array:
        """Speed in m/s at the times `t` in s, same shape."""
        ...


@dataclass(frozen=True, slots=True)
class Action:
    """A controller's answer for one tick: `command` in the drive's unit, its status, the predicted path ((k,) positions
    in m or None) and the seconds each phase took. `cut_after`: the steps after which the deadline cut the plan; None if
    it did not.
    """

    command: float
    status: Status = "ok"
    predicted: Array | None = None
    timings: Mapping[str, float] = field(default_factory=dict)
    cut_after: int | None = None


class Controller(Protocol):
    """What every controller implements. No method raises; all take bounded time."""

    name: str

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """Begin at `now` in s with `command` in force, without a bump."""
        ...

    def follow(self, command: float, rate: float) -> None:
        """Receive the command in force and its `rate` per second before each `act`, after limits."""
        return

    def allow(self, steps: int) -> None:
        """Cut the next plan after `steps` iterations, as the deadline did before: replays are exact."""
        return

    def calm(self) -> bool:
        """Halve the loop gain because the loop oscillates; returns whether this controller can."""
        return False

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        """The command for the tick that begins at `now` in s."""
        ...
