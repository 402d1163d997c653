"""The C controller in Python: an estimator and a supervisor with the interface of those in Python."""

from __future__ import annotations

import ctypes
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from controller.estimator.base import CURRENT, Counts, Observer
from controller.limits import Envelope, Issued, Limits, number
from controller.model.control_model import ControlModel
from controller.registry import Chain, build, noise_of
from controller.signals import Action, Adapted, Array, Controller, Estimate, Measurement, Reference, Status
from controller.step.library import READINGS, Library, Out, available, loaded, memory, pointer_to
from controller.step.library import Issued as IssuedC
from controller.step.numbers import CHAINS, Numbers, numbers_of
from controller.supervision.fallback import Event
from controller.supervision.supervisor import Supervisor
from models.theta import bare

_STATUSES: Final[tuple[Status, ...]] = ("ok", "late", "failed", "lost", "limited", "stopped")
_LIMITS: Final = ("previous", "temperature", "command", "estimate", "range", "gap", "speed", "rate")
_REASONS: Final = (
    *("start", "estimate lost", "recovered", "", "{} answered failed", "{} limited too long: {}"),
    *("{} swings about the reference", "tried again", "no controller is left: {} swings about the reference", ""),
)
_NEWEST: Final[deque[tuple[tuple[str, ControlModel, Envelope], Compiled]]] = deque(maxlen=16)
_HALTED, _TAKEN_OVER = 3, 9  # reasons that Python knows better


@dataclass(frozen=True)
class Compiled:
    """The compiled controller of one model: its library, and its numbers in memory."""

    library: Library
    numbers: Array
    name: str
    model: ControlModel
    stage_s: float
    reach_s: float


def compiled(name: str, model: ControlModel, envelope: Envelope, numbers: Numbers | None = None) -> Compiled | None:
    """The C controller `name` of `model`, of other `numbers` than the usual ones where given; None for one that is not
    written in C, without a compiler, and, unless `numbers` are given, of an inner mass whose readings may be older than
    usual: another filter suits it better. The newest are kept: supervisor and estimator ask for the same, and so does
    each trial of a choice.
    """
    if not available():
        return None
    for asked, kept in _NEWEST:
        if numbers is None and asked[0] == name and asked[1] is model and asked[2] == envelope:
            return kept
    if numbers is None and envelope.shaken and envelope.limits.age_s > Limits.age_s:
        return None
    found = _compiled(name, model, envelope, numbers)
    if found is not None:
        _NEWEST.appendleft(((name, model, envelope), found))
    return found


def _compiled(name: str, model: ControlModel, envelope: Envelope, numbers: Numbers | None) -> Compiled | None:
    if name not in CHAINS:
        return None
    numbers = numbers_of(name, model, envelope) if numbers is None else numbers
    library = loaded(numbers)
    if library is None:
        return None
    stage_s, reach_s = (float(numbers.values.get(key, 0.0)) for key in ("stage_s", "reach_s"))
    return Compiled(library, numbers.vector, name, model, stage_s, reach_s)


def supervisor_of(
    name: str, model: ControlModel, envelope: Envelope, deadline_s: float = math.inf, in_c: bool = True
) -> Supervisor:
    """The supervised controller `name` of `model` within `envelope`: in C where that is asked for and there is a
    compiler, else in Python with `deadline_s` for the MPC. Errors as `build`.
    """
    found = compiled(name, model, envelope) if in_c else None
    if found is None:
        return Supervisor(build(name, model, envelope, deadline_s), envelope)
    return CompiledSupervisor((CompiledChain(found),), envelope)


class CompiledEstimator:
    """`ParticleEstimator` in C: the same filter with another sequence of random numbers."""

    def __init__(self, found: Compiled, envelope: Envelope) -> None:
        self._library, self._numbers = found.library, found.numbers
        self.model = model = found.model.sharp
        self.noise = noise_of(found.name, model, envelope.limits.age_s)
        self._memory = memory(found.library.estimator)
        self._belief = found.library.Belief.from_buffer(self._memory, found.library.belief_at)
        self._in = found.library.In()
        self._state, self._std, self._parameters, self._innovation = (
            np.frombuffer(getattr(self._belief, name)) for name in ("state", "std", "parameters", "innovation")
        )
        current = any(bare(name) == "current_A" for name in model.states)
        self._channels = {str(model.drive.commanded): 1, "position_m": 0} | ({CURRENT: 2} if current else {})
        self._at, self._given = ctypes.byref(self._memory), ctypes.byref(self._in)
        self._run = found.library.functions.capsule_estimate
        self.reset(0.0, 0.0)

    @property
    def counts(self) -> Counts:
        b = self._belief
        return Counts(b.accepted, b.outliers, b.unusable, b.restarts, b.followed)

    @counts.setter
    def counts(self, counts: Counts) -> None:
        b, c = self._belief, counts
        b.accepted, b.outliers, b.unusable = c.accepted, c.outliers, c.unusable
        b.restarts, b.followed = c.restarts, c.followed

    @property
    def offset(self) -> float:
        return float(self._belief.offset)

    def reset(self, now: float, command: float) -> None:
        """As `Estimator.reset`."""
        counts = self.counts
        start = self._library.functions.capsule_estimator_init
        start(self._at, pointer_to(self._numbers), ctypes.c_double(now), ctypes.c_double(command))
        self.counts = counts

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        """As `Estimator.observe`."""
        given, belief = self._in, self._belief
        newest = measurements[-READINGS:]
        given.time_s, given.in_force, given.readings = now, command, len(newest)
        for k, m in enumerate(newest):
            reading = given.reading[k]
            reading.stamp_s, reading.value, reading.channel = m.stamp_s, m.value, self._channels.get(m.channel, 3)
        self._run(self._at, self._given)
        state, std, lost = self._state.copy(), self._std.copy(), bool(belief.lost)
        if not belief.learned:
            return Estimate(now, state, std, 0.0, lost)
        innovations = tuple(self._innovation[: belief.innovations].tolist())
        adapted = Adapted(self._parameters.copy(), belief.force_N)
        return Estimate(now, state, std, belief.lacking_N, lost, adapted, innovations, belief.surprise)


class CompiledChain(Controller):
    """A controller with its fallbacks, in C, and its memory; it is asked by a `CompiledSupervisor` alone."""

    def __init__(self, found: Compiled) -> None:
        self.compiled, self.name, self.names = found, found.name, CHAINS[found.name]
        self.library = library = found.library
        self._memory, self.given, self.out, self._belief = (
            memory(library.controller),
            library.In(),
            Out(),
            library.Belief(),
        )
        self.at = ctypes.byref(self._memory)
        self.issued = IssuedC.from_buffer(self._memory, library.issued_at)
        self._reason = ctypes.c_int.from_buffer(self._memory, library.reason_at)
        self._positions, self._speeds = (np.frombuffer(one) for one in (self.given.position_m, self.given.speed_m_s))
        self._state, self._std, self._parameters = (
            np.frombuffer(getattr(self._belief, name)) for name in ("state", "std", "parameters")
        )
        self._grid = np.append(np.arange(self._positions.size) * found.stage_s, found.reach_s)
        self._arguments = (self.at, *(ctypes.byref(one) for one in (self._belief, self.given, self.out)))
        self._control = library.functions.capsule_control

    @property
    def reason(self) -> int:
        return self._reason.value

    def start(self, now: float, estimate: Estimate, command: float) -> None:
        """Begin at `now` with `command` in force."""
        self.believe(estimate)
        start = self.library.functions.capsule_controller_init
        numbers, belief = pointer_to(self.compiled.numbers), self._arguments[1]
        start(self.at, numbers, ctypes.c_double(now), belief, ctypes.c_double(command))

    def believe(self, estimate: Estimate) -> None:
        """Take the estimate of this tick; an unreadable one is lost."""
        belief = self._belief
        try:
            learned = estimate.adapted
            belief.time_s, belief.lacking_N = number(estimate.time_s), number(estimate.disturbance_N)
            self._state[:], self._std[:], belief.lost = estimate.state, estimate.std, bool(estimate.lost)
            belief.learned = learned is not None
            if learned is not None:
                self._parameters[:], belief.force_N = learned.parameters, number(learned.disturbance_N)
        except Exception:  # noqa: BLE001 - an unreadable estimate is lost
            belief.lost = True

    def refer(self, now: float, reference: Reference) -> None:
        """Take the reference over the horizon; an unreadable one is not a number."""
        times = now + self._grid
        try:
            self._positions[:] = reference.position(times)[:-1]
            speeds = reference.speed(times)
            self._speeds[:], self.given.next_speed_m_s = speeds[:-1], speeds[-1]
        except Exception:  # noqa: BLE001 - an unreadable reference has no value
            self._positions[:], self._speeds[:], self.given.next_speed_m_s = math.nan, math.nan, math.nan

    def run(self) -> None:
        """One tick; the answer is in `out`."""
        self._control(*self._arguments)

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        raise NotImplementedError("a chain in C is asked by its supervisor")

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        self.start(now, estimate, command)


class CompiledSupervisor(Supervisor):
    """`Supervisor` in C. There is no deadline: the time of every controller is bounded by iterations."""

    def _begin(self, chain: tuple[Controller, ...], now: float) -> None:
        """Begin with `chain`, a single `CompiledChain`, from the command that is in force."""
        (new,) = chain
        if not isinstance(new, CompiledChain):
            raise TypeError(f"chain must be one in C beside one in C; got {new.name}")
        before = getattr(self, "_held", None)
        self._chain, self._held, self._reason = chain, new, "new model"
        self._resting_s, self._active = -1.0, -1
        new.start(now, self._blind(new, now), math.nan)
        if before is not None:
            new.library.functions.capsule_continue(new.at, before.at)

    @staticmethod
    def _blind(chain: CompiledChain, now: float) -> Estimate:
        nothing = chain.compiled.model.initial() * math.nan
        return Estimate(now, nothing, nothing, lost=True)

    @property
    def active(self) -> str:
        return self._held.names[self._active] if self._active >= 0 else "stop"

    def chain_for(self, name: str, model: ControlModel, deadline_s: float) -> Chain:
        found = compiled(name, model, self.envelope)
        if found is None:
            raise ValueError(f"offered model must have a controller in C, as the one in use has; got none for {name}")
        return (CompiledChain(found),)

    def observer_for(self, name: str, model: ControlModel, estimator: str) -> Observer:
        found = compiled(name, model, self.envelope) if estimator == "default" else None
        return (
            super().observer_for(name, model, estimator) if found is None else CompiledEstimator(found, self.envelope)
        )

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        self.halted, self._active, self._resting_s = "", -1, -1.0
        self._now = number(now)
        self._held.start(self._now, estimate, number(command))
        self.issued = Issued(self._held.issued.command)

    def allow(self, steps: int | None) -> None:
        """Nothing: no deadline cuts a plan."""

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        held, self._now = self._held, number(now) if math.isfinite(number(now)) else self._now
        given, out = held.given, held.out
        given.time_s, given.halt = number(now), bool(self.halted)
        (given.least, given.most), given.temperature_C = self.room, number(self.temperature_C)
        held.believe(estimate)
        held.refer(self._now, reference)
        held.run()
        for k in range(out.events):
            event = out.event[k]
            names = (*held.names, "stop")
            before, self._led = self._led or names[event.before], ""
            self.events.append(Event(self._now, before, names[event.after], self._said(event.reason)))
        if out.halted and not self.halted:
            self.halted = self._said(held.reason)
        self._active, self._resting_s = out.active, out.resting_s
        self.issued = Issued(out.command, out.rate)
        return Action(out.command, _STATUSES[out.status])

    def _said(self, reason: int) -> str:
        """The sentence for a reason of the C controller."""
        rank, limits = (reason >> 8 & 255) - 1, reason >> 16
        names = sorted(name for k, name in enumerate(_LIMITS) if limits >> k & 1)
        text = {_HALTED: self.halted, _TAKEN_OVER: self._reason}.get(reason & 255) or _REASONS[reason & 255]
        return text.format(self._held.names[rank] if rank >= 0 else "", ", ".join(names))
