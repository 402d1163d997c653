"""Stub controllers and short runs for the supervisor's tests."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from controller.drives import envelope_of
from controller.signals import Action, Array, Estimate, Reference
from controller.supervision.fallback import Rules
from controller.supervision.supervisor import Supervisor
from models.drives.magnetic import Magnetic

DT = 0.002


@dataclass
class Ramp:
    """A reference that moves at `rate`."""

    rate: float = 0.0

    def position(self, t: Array) -> Array:
        return self.rate * t

    def speed(self, t: Array) -> Array:
        return np.full_like(t, self.rate)


@dataclass
class Stub:
    """A controller that answers as `answer` says; counts how often it was asked and reset."""

    name: str
    answer: Callable[[float], Any]
    resets: list[tuple[float, float]] = field(default_factory=list)
    asked: int = 0
    followed: float = 0.0

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        self.resets.append((now, command))

    def follow(self, command: float, rate: float) -> None:
        self.followed = command

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Any:
        self.asked += 1
        return self.answer(now)


def steady(name: str, command: float) -> Stub:
    return Stub(name, lambda now: Action(command))


def raises(now: float) -> Action:
    raise RuntimeError("no solution")


def estimate(now: float, x: float = 0.0, v: float = 0.0, lost: bool = False) -> Estimate:
    return Estimate(now, np.array([x, v]), np.array([1e-4, 1e-3]), 0.0, lost)


def run(
    supervisor: Supervisor,
    ticks: int,
    start: int = 0,
    believed: Callable[[float], Any] = estimate,
    reference: Reference | None = None,
) -> list[Action]:
    reference = Ramp(1e-3) if reference is None else reference
    return [supervisor.act(i * DT, believed(i * DT), reference) for i in range(start, start + ticks)]


def magnetic(*chain: Stub, rules: Rules | None = None) -> Supervisor:
    supervisor = Supervisor(chain, envelope_of(Magnetic()), rules)
    supervisor.reset(0.0, estimate(0.0), 0.0)
    return supervisor
