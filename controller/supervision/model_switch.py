"""How a new model takes over: its estimator runs beside the present one; both switch with the controllers at rest."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from controller.estimator.base import Counts, Observer
from controller.estimator.kinematic_filter import KinematicFilter
from controller.model.control_model import ControlModel
from controller.monitor import NOT_WATCHED, Health, Monitor
from controller.registry import Chain
from controller.signals import Array, Estimate, Measurement
from controller.supervision.acceptance import Acceptance
from controller.supervision.others import Others
from controller.supervision.supervisor import Supervisor

ROOM: Final = 1 << 18  # stored readings of a channel: nine minutes at 500 Hz

_FIRST_LOOK: Final = 256  # rows of the first search


class History:
    """Keeps the newest `room` readings of each of `channels`, in memory allocated at the start. `add` never raises."""

    def __init__(self, channels: Sequence[str], room: int = ROOM) -> None:
        self._rows = {name: np.full((2, room), np.nan) for name in channels}  # times and values, in a ring
        self._counts, self._room = dict.fromkeys(channels, 0), room

    def add(self, measurements: Sequence[Measurement]) -> None:
        for m in measurements:
            if m.channel in self._rows:
                self._rows[m.channel][:, self._counts[m.channel] % self._room] = m.stamp_s, m.value
                self._counts[m.channel] += 1

    def since(self, channel: str, begin_s: float) -> tuple[Array, Array]:
        """Increasing times from `begin_s` on, and values of a channel, (n,) each; readings out of order are left out.
        The time it takes depends on their number, not on the room: a tick may ask.
        """
        rows, count = self._rows[channel], self._counts[channel]
        there, end = min(count, self._room), count % self._room
        reach = min(_FIRST_LOOK, there)
        while reach < there and rows[0, (count - reach) % self._room] >= begin_s:
            reach = min(2 * reach, there)
        newest = np.hstack((rows[:, end - reach :], rows[:, :end])) if reach > end else rows[:, end - reach : end]
        times, values = newest[:, (newest[0] >= begin_s) & np.isfinite(newest[1])]
        new = times > np.maximum.accumulate(np.append(-np.inf, times))[:-1]
        return times[new], values[new]


@dataclass(frozen=True)
class Offer:
    """A `model` to take over from `at_s` on, in s of the reference's time, if its `verdict` passed."""

    model: ControlModel
    verdict: Acceptance
    at_s: float = 0.0


@dataclass(frozen=True)
class Prepared:
    """An offer with the controllers, the estimator and the monitor of its model."""

    offer: Offer
    chain: Chain
    observer: Observer
    monitor: Monitor | None

    def at(self, at_s: float) -> Prepared:
        """The same from another time on, in s of the reference's time."""
        return replace(self, offer=replace(self.offer, at_s=at_s))


class ModelSwitch:
    """The estimator in use, and that of an offered model beside it. From `begin` + `offer.at_s` on the offered one gets
    the same measurements. Once it is not lost, and capsule and reference have been at rest, it and its controllers take
    over in one tick, `taken_at` in s of the reference's time. Offers queue and are built when made; `history`, if any,
    keeps the measurements.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        controller: str,
        model: ControlModel,
        offer: Offer | None = None,
        deadline_s: float = math.inf,
        estimator: str = "default",
        others: Mapping[str, ControlModel] = MappingProxyType({}),
        watched: bool = True,
    ):
        """Unless `watched`, no monitor judges the model. Raises ValueError for a model that this controller cannot use,
        or one with another tick.
        """
        self._supervisor, self._controller, self._deadline_s = supervisor, controller, deadline_s
        self._estimator = estimator
        self._present = supervisor.observer_for(controller, model, estimator)
        self._waiting: deque[Prepared] = deque()
        self.taken_at, self.switches = math.nan, 0
        self.origin_s = math.inf  # when the reference began, on the clock of `observe`
        self._monitor = _monitor_of(self._present) if watched else None
        self.history: History | None = None
        self.switched: list[tuple[float, str]] = []
        self._beside = {name: self.prepare(Offer(other, Acceptance())) for name, other in others.items()}
        self._others = Others(
            {
                name: (one.observer, one.monitor)
                for name, one in self._beside.items()
                if not isinstance(one.observer, KinematicFilter) and one.monitor is not None
            }
        )
        if offer is not None:
            self.propose(offer)

    def propose(self, offer: Offer) -> None:
        """Queue a model. Errors as the constructor."""
        self.put(self.prepare(offer))

    def prepare(self, offer: Offer) -> Prepared:
        """The slow part of an offer; another thread may do it. Errors as the constructor."""
        if offer.model.tick_s != self.tick_s:
            raise ValueError(f"offered model must have the tick in use, {self.tick_s:g} s; got {offer.model.tick_s:g}")
        chain = self._supervisor.chain_for(self._controller, offer.model, self._deadline_s)
        observer = self._supervisor.observer_for(self._controller, offer.model, self._estimator)
        return Prepared(offer, chain, observer, _monitor_of(observer))

    def put(self, prepared: Prepared) -> None:
        if prepared.offer.verdict.passed:
            self._waiting.append(prepared)
        if not prepared.offer.verdict.passed or len(self._waiting) == 1:
            self._supervisor.offer(prepared.chain, prepared.offer.verdict)

    @property
    def health(self) -> Health:
        """The monitor's result on the model in use, times on the clock of `observe`."""
        return NOT_WATCHED if self._monitor is None else self._monitor.health

    @property
    def tick_s(self) -> float:
        return self._present.model.tick_s

    @property
    def model(self) -> ControlModel:
        return self._present.model

    @property
    def counts(self) -> Counts:
        return self._present.counts

    def begin(self, origin_s: float) -> None:
        self.origin_s = origin_s
        if self._monitor is not None:
            self._monitor.begin(origin_s)

    def reset(self, now: float, command: float) -> None:
        for observer in (self._present, *(waiting.observer for waiting in self._waiting)):
            observer.reset(now, command)

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        estimate = self._present.observe(now, command, measurements)
        if self._monitor is not None and now >= self.origin_s:
            self._monitor.look(now, command, estimate)
        if self.history is not None:
            self.history.add(measurements)
        if self._monitor is not None and now >= self.origin_s:
            better = self._others.observe(now, command, measurements, self._monitor)
            if better is not None:
                self._lead_on(better[0], now)
                return better[1]
        if not self._waiting or now < self.origin_s + self._waiting[0].offer.at_s:
            return estimate
        fresh = self._waiting[0].observer.observe(now, command, measurements)
        if fresh.lost or not self._supervisor.take_offered():
            return estimate
        self._take_over(self._waiting.popleft(), now)
        self.taken_at = now - self.origin_s
        return fresh

    def _lead_on(self, name: str, now: float) -> None:
        prepared = self._beside.pop(name)
        self._others.drop(name)
        self._supervisor.lead_on(prepared.chain, f"the model is broken, {name} predicts better")
        self._take_over(prepared, now)
        self.switched.append((now - self.origin_s, name))

    def _take_over(self, prepared: Prepared, now: float) -> None:
        """Continue with the `prepared` model: nothing is built in this tick."""
        prepared.observer.counts = replace(self._present.counts)
        self._present = prepared.observer
        self.switches += 1
        if self._waiting:
            first = self._waiting[0]
            self._supervisor.offer(first.chain, first.offer.verdict)
        alarms = self.health.alarms
        self._monitor = prepared.monitor
        if self._monitor is not None:
            self._monitor.begin(now, alarms)


def _monitor_of(observer: Observer) -> Monitor | None:
    return None if isinstance(observer, KinematicFilter) else Monitor(observer)
