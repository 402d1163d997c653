"""A new model's way in: its estimator looks on from the offer, and takes over together with its controllers, at a
rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

from controller.estimator.base import Counts, Receiver
from controller.model.control_model import ControlModel
from controller.monitor.monitor import NOT_WATCHED, Health, Monitor
from controller.registry import Observer, build, estimator_for
from controller.signals import Estimate, Measurement
from controller.supervision.acceptance import Verdict
from controller.supervision.supervisor import Supervisor


@dataclass(frozen=True)
class Offer:
    """A `model` of the rig in use that is to take over from `at_s` on, in s of the reference's time, if its `verdict`
    passed.
    """

    model: ControlModel
    verdict: Verdict
    at_s: float = 0.0


class ModelSwitch:
    """The estimator in use, and the one of an offered model beside it.

    `observe` answers with the one in use. From `begin` + `offer.at_s` on the offered one sees the same measurements;
    once it is not lost and the supervisor has seen the capsule at rest long enough, it and the controllers of its model
    take over in one tick, `taken_at` in s of the reference's time. Both are built here, before the first tick.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        controller: str,
        model: ControlModel,
        offer: Offer | None = None,
        deadline_s: float = math.inf,
    ):
        """Raises ValueError for a model that this controller cannot use, and for one of another tick than the one in
        use.
        """
        self._supervisor, self._offer = supervisor, offer
        self._present: Observer = estimator_for(controller, model)
        self._next: Observer | None = None
        self._origin, self.taken_at = math.inf, math.nan
        self._monitor = _monitor_of(self._present)
        if offer is not None:
            if offer.model.tick_s != model.tick_s:
                raise ValueError(
                    f"offered model must have the tick in use, {model.tick_s:g} s; got {offer.model.tick_s:g}"
                )
            if supervisor.offer(build(controller, offer.model, supervisor.envelope, deadline_s), offer.verdict):
                self._next = estimator_for(controller, offer.model)

    @property
    def health(self) -> Health:
        """What the monitor says of the model in use, times on the clock of `observe`."""
        return NOT_WATCHED if self._monitor is None else self._monitor.health

    @property
    def origin_s(self) -> float:
        """When the reference began, on the clock of `observe`; inf before."""
        return self._origin

    @property
    def counts(self) -> Counts:
        """What became of the measurements so far."""
        return self._present.counts

    def begin(self, origin_s: float) -> None:
        """The reference begins at `origin_s`."""
        self._origin = origin_s
        if self._monitor is not None:
            self._monitor.begin(origin_s)

    def reset(self, now: float, command: float) -> None:
        """Know nothing but the `command` in force at `now`."""
        for observer in (self._present, self._next):
            if observer is not None:
                observer.reset(now, command)

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        """The estimate at `now`, as `Estimator.observe`, by whichever is in use."""
        estimate = self._present.observe(now, command, measurements)
        if self._monitor is not None and now >= self._origin:
            self._monitor.look(now, command, estimate)
        if self._next is None or self._offer is None or now < self._origin + self._offer.at_s:
            return estimate
        fresh = self._next.observe(now, command, measurements)
        if fresh.lost or not self._supervisor.take_offered():
            return estimate
        for field in fields(Counts):
            setattr(self._next.counts, field.name, getattr(self._present.counts, field.name))
        self._present, self._next, self.taken_at = self._next, None, now - self._origin
        alarms = self.health.alarms
        self._monitor = _monitor_of(self._present)
        if self._monitor is not None:
            self._monitor.begin(now, alarms)
        return fresh


def _monitor_of(observer: Observer) -> Monitor | None:
    """The monitor of the model that an estimator believes in; None where it believes in none."""
    return Monitor(observer) if isinstance(observer, Receiver) else None
