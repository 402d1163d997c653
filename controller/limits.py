"""Limits: one record of numbers with their sources, and one pure function that every command passes last."""

import math
from dataclasses import dataclass, field, fields
from numbers import Real
from typing import Any

_SHORTEST_TICK = 1e-6  # s
_NEAR = 1e-9  # share of the range within which two commands are equal
_LEAST = 1e-6  # smallest value of a limit, in its unit


def _limit(meaning: str, value: float, most: float, least: float = _LEAST) -> Any:
    return field(default=value, metadata={"meaning": meaning, "least": least, "most": most})


@dataclass(frozen=True)
class Limits:
    """What no command may exceed, SI; each field states unit, source and largest value. Not clinical advice."""

    force_N: float = _limit(
        "greatest force on the wall (choice: half of weak contractions' 0.9 N/cm, Terry 2012, live pig)", 0.5, 20.0
    )
    speed_m_s: float = _limit(
        "greatest speed of the capsule (choice: 15 times paper V's; beyond, the law is extrapolated)", 0.3, 5.0
    )
    carriage_speed_m_s: float = _limit(
        "greatest speed of the carriage (reduced speed beside a person, ISO 10218-1, from memory)", 0.25, 5.0
    )
    first_speed_m_s: float = _limit(
        "speed of the carriage allowed when a run on a rig enables it; the same share of the range of a coil or inner"
        " mass (choice: a person beside it sees it begin)",
        0.02,
        5.0,
    )
    first_acceleration_m_s2: float = _limit(
        "growth of that speed (or share) until all of it is allowed (choice: a second)", 0.25, 1e3
    )
    carriage_acceleration_m_s2: float = _limit(
        "greatest acceleration of the carriage (choice: from full speed to rest within 25 ms)", 10.0, 1e3
    )
    travel_m: float = _limit("greatest distance of the carriage from its zero (choice)", 1.0, 20.0)
    gap_share: float = _limit(
        "usable share of the gap of greatest pull (choice: beyond r/sqrt(3) the magnet lets go)", 0.95, 1.0
    )
    gap_stds: float = _limit("margin of the gap in standard deviations of the estimated position (choice)", 3.0, 100.0)
    envelope_m: float = _limit(
        "greatest distance of carriage and capsule from the wanted position; 0: the gap of greatest pull, 10 mm for a"
        " coil, 20 mm for an inner mass (choice: a third or two thirds of a capsule's length)",
        0.0,
        1.0,
        least=0.0,
    )
    current_A: float = _limit("greatest coil current (choice: 0.5 N at the default coil's 0.5 N/A)", 1.0, 50.0)
    current_rate_A_s: float = _limit(
        "fastest change of the coil current (12 V of the PWM capsubot across the default coil's 10 mH)", 1200.0, 1e6
    )
    temperature_C: float = _limit(
        "temperature at which the drive switches off (applied part for 10 min, IEC 60601-1, from memory)", 43.0, 80.0
    )
    derate_C: float = _limit("temperature above which its range shrinks (choice: 2 K below that)", 41.0, 80.0)
    age_s: float = _limit("age of the last localisation at which the drive stops (choice)", 0.15, 10.0)
    longest_tick_s: float = _limit("longest pause that counts when a command's rate is limited (choice)", 0.02, 1.0)

    def __post_init__(self) -> None:
        for name, (least, most) in self.ranges().items():
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
                raise ValueError(f"limit {name} must be a number from {least:g} to {most:g}; got {value!r}")
        if self.derate_C >= self.temperature_C:
            raise ValueError(
                f"limit derate_C must be below temperature_C = {self.temperature_C:g}; got {self.derate_C:g}"
            )

    @classmethod
    def ranges(cls) -> dict[str, tuple[float, float]]:
        """Least and greatest value of each limit by name."""
        return {f.name: (f.metadata["least"], f.metadata["most"]) for f in fields(cls)}


@dataclass(frozen=True, slots=True)
class Envelope:
    """`Limits` in the unit of one drive's command (`controller.drives`): range [`low`, `high`], `rate` per second,
    `acceleration` per second squared, largest `gap_m` between carriage and capsule, each inf where it does not apply.
    `sense`: sign of the force of a positive command. `placed`: the command is a carriage position and rests where it
    is; other commands rest at 0. `shaken`: an inner mass shakes the capsule. `without_gap_m`: half width of the
    envelope around the wanted position without a gap.
    """

    low: float
    high: float
    limits: Limits
    rate: float = math.inf
    acceleration: float = math.inf
    gap_m: float = math.inf
    sense: float = 1.0
    placed: bool = False
    shaken: bool = False
    without_gap_m: float = 0.01

    @property
    def around_m(self) -> float:
        """Half width in m of the envelope around the wanted position."""
        if self.limits.envelope_m:
            return self.limits.envelope_m
        return self.gap_m / self.limits.gap_share if math.isfinite(self.gap_m) else self.without_gap_m

    def neutral(self, position_m: float) -> float:
        """The command without force: 0, or the carriage above the capsule (mid-travel if the position is unknown)."""
        if not self.placed:
            return 0.0
        return _within(position_m, self.low, self.high) if math.isfinite(position_m) else 0.5 * (self.low + self.high)


@dataclass(frozen=True, slots=True)
class Issued:
    """A command that was sent, in the drive's unit, its rate per second, and its `aim`."""

    command: float
    rate: float = 0.0
    aim: float = math.nan


@dataclass(frozen=True, slots=True)
class Seen:
    """What is known when a command is limited: age of the estimate in s, standard deviation of the position in m."""

    position_m: float
    speed_m_s: float
    age_s: float = 0.0
    lost: bool = False
    temperature_C: float = 20.0
    std_m: float = 0.0


def limited(
    wanted: object, previous: Issued, seen: Seen, dt: float, envelope: Envelope
) -> tuple[Issued, tuple[str, ...]]:
    """The command nearest to `wanted` that breaks no limit, `dt` s after `previous`, and the names of the limits that
    acted. Never raises.

    The result is a finite command in [`low`, `high`], at most `rate dt` from `previous`; its rate changes by at most
    `acceleration dt`, and it can still stop within the range. `dt` counts as 0 below 1 us or if not a number, and as at
    most `longest_tick_s`.

    The safe state is zero current, inner mass off, carriage at rest. It answers a `wanted` that is not finite, a lost,
    stale or impossible estimate, and the temperature limit. Above `derate_C` a current's range (a carriage's rate)
    shrinks in proportion.

    A capsule faster than `speed_m_s` is not accelerated further. The carriage stays within the gap in which the magnet
    holds, less `gap_stds` of the position, and brakes ahead of its end. A `previous` out of range or not finite counts
    as the nearest valid command at rest.
    """
    e, limits, broken = envelope, envelope.limits, list[str]()
    aim, before, rate, dt = number(wanted), number(previous.command), number(previous.rate), number(dt)
    x, v, warm = number(seen.position_m), number(seen.speed_m_s), number(seen.temperature_C)

    def within(name: str, low: float, high: float) -> float:
        clipped = min(max(aim, low), high)
        if clipped != aim:
            broken.append(name)
        return clipped

    if not (e.low <= before <= e.high and abs(rate) <= e.rate):
        broken.append("previous")
        before, rate = _within(before if math.isfinite(before) else e.neutral(x), e.low, e.high), 0.0
    dt = min(dt, limits.longest_tick_s) if dt >= _SHORTEST_TICK else 0.0
    share = _within((limits.temperature_C - warm) / (limits.temperature_C - limits.derate_C), 0.0, 1.0)
    share = share if warm == warm else 0.0
    # the capsule of a carriage lies within reach of the magnet from some position of its travel
    possible = math.isfinite(x) and (not e.placed or e.low - e.gap_m <= x <= e.high + e.gap_m)
    blind = bool(seen.lost) or not (0 <= number(seen.age_s) <= limits.age_s and math.isfinite(v) and possible)
    unasked = not math.isfinite(aim)
    broken += [name for name, so in (("temperature", share < 1), ("command", unasked), ("estimate", blind)) if so]
    if blind or unasked:
        aim = before if e.placed else 0.0
    left = 1.0 if e.placed else share
    aim = within("range", left * e.low, left * e.high)
    room = (e.low, e.high)
    if not blind and e.placed:
        margin = limits.gap_stds * number(seen.std_m)
        gap = max(e.gap_m - margin, 0.0) if margin >= 0 else 0.0
        room = _within(x - gap, e.low, e.high), _within(x + gap, e.low, e.high)
        aim = within("gap", *room)
    if not blind and abs(v) > limits.speed_m_s and not e.shaken:
        most = before if e.placed else 0.0
        aim = within("speed", -math.inf, most) if v * e.sense > 0 else within("speed", most, math.inf)
    issued = _reached(aim, before, rate, number(previous.aim), dt, share, room, e)
    if abs(issued.command - aim) > _NEAR * (e.high - e.low):
        broken.append("rate")
    return issued, tuple(broken)


def number(value: object) -> float:
    """`value` as a float, NaN if it is not a number. Never raises."""
    if isinstance(value, float):
        return float(value)
    if not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except (TypeError, ValueError, ArithmeticError):
        return math.nan


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


def _reached(
    aim: float,
    before: float,
    rate: float,
    last_aim: float,
    dt: float,
    share: float,
    room: tuple[float, float],
    envelope: Envelope,
) -> Issued:
    """The part of `aim` reachable within `dt` under rate and acceleration, so that it stops within `room`. The carriage
    moves with its aim (its rate since `last_aim`) and closes the distance as fast as it can still brake.
    """
    if dt == 0 or math.isinf(envelope.rate):
        command, new_rate = (before, rate) if dt == 0 else (aim, 0.0)
    else:
        fastest = envelope.rate * (share if envelope.placed else 1.0)
        able, a = _within((aim - before) / dt, -fastest, fastest), envelope.acceleration
        if math.isfinite(a):
            along = _within((aim - last_aim) / dt, -fastest, fastest) if math.isfinite(last_aim) else 0.0
            behind = aim - before - along * dt
            able = _within(along + math.copysign(_braking(abs(behind), dt, a), behind), -fastest, fastest)
            able = _within(able, -_braking(before - room[0], dt, a), _braking(room[1] - before, dt, a))
            able = _within(able, rate - a * dt, rate + a * dt)
        command = _within(before + able * dt, envelope.low, envelope.high)
        new_rate = able if command == before + able * dt else 0.0
    return Issued(command, new_rate, aim)


def _braking(room: float, dt: float, a: float) -> float:
    """Greatest rate w for `dt` that deceleration `a` still stops within `room`: `w dt + w^2/(2 a) = room`."""
    return a * dt * (math.sqrt(1 + 2 * max(room, 0.0) / (a * dt * dt)) - 1)
