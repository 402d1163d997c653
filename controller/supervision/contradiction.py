"""Localisation, drive and capsule compared with each other and with the wanted position, without any estimator."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

from controller.limits import Envelope
from controller.supervision.breakaway import FREE, Breakaway, Resistance

CONTRADICT: Final = "sensor or drive contradict each other"
_SLACK_M: Final = 2e-3  # margin of the envelope
_STDS: Final = 6.0  # standard deviations of readings beyond which two contradict each other
_PUSHES: Final = 0.15  # share of the drive's limit that counts as a push
_AGAINST: Final = (5e-3, 0.5)  # m and share of the envelope that a capsule may move against the push
_HARD: Final = 0.9  # share of a magnet's gap that counts as a hard pull
_PULLED_S: Final = 1.0  # hard pull of a magnet without an answer
_ON_S: Final = 2.0  # swing of an inner mass without an answer
_IN_VAIN: Final = (2.6, 0.08)  # times friction, and seconds of it, that must move a capsule
_MEAN: Final = 0.3  # weight of a new reading in the smoothed one
_MOVED_M: Final = 5e-4  # distance that answers a push
_MEAN_STDS: Final = 1.7  # standard deviations of readings, four of the smoothed ones
_SHAKEN_STDS: Final = 2.4  # the same for the difference of two smoothed ones
_SLIPS_M_S: Final = 0.2  # speed of a slip between two readings
_FASTEST_M_S: Final = 1.0  # speed above every real motion
CONFIRMED: Final = 3  # readings in a row that confirm a jump
_SPEED: Final = 0.5  # share of the speed limit that readings must stay below
_APART_S: Final = 0.04  # time between two readings for a speed
_SLIP_APART_S: Final = 0.018  # the same where the push is cut: two readings at 100 Hz
_SLIPS: Final = (0.25, 2.5)  # share of the speed limit, and standard deviations of two readings, from which it slips
_PLACES: Final = 64  # readings that are kept for it


@dataclass(slots=True)
class Corridor:
    """The envelope around the wanted position: a position may be `half_m` from it, or `slack_m` farther than before. A
    reference that jumps, faster than `speed_m_s`, widens it by the jump; it shrinks as the position approaches.
    """

    half_m: float
    speed_m_s: float
    slack_m: float
    room_m: float = math.inf
    wanted_m: float = math.nan

    def leaves(self, position_m: float, wanted_m: float, dt: float) -> bool:
        """Whether the position, `dt` s after the last call, is outside."""
        jump_m = abs(wanted_m - self.wanted_m) - self.speed_m_s * dt
        if jump_m > 0:
            self.room_m += jump_m
        self.wanted_m = wanted_m
        off_m = abs(position_m - wanted_m)
        if off_m > self.room_m:
            return True
        self.room_m = max(self.half_m, min(self.room_m, off_m + self.slack_m))
        return False


@dataclass(slots=True)
class JumpCheck:
    """Accepts a reading no farther from the last accepted one than a capsule slips meanwhile. After a jump,
    `CONFIRMED` readings in a row must agree, or move at no more than `_FASTEST_M_S`.
    """

    noise_m: float
    position_m: float = math.nan
    candidate_m: float = math.nan
    at: float = -math.inf
    refused_at: float = -math.inf
    agree: int = 0

    def takes(self, position_m: float, stamp_s: float) -> bool:
        apart_m = _STDS * self.noise_m
        if abs(position_m - self.position_m) > _SLIPS_M_S * abs(stamp_s - self.at) + apart_m:
            again = abs(position_m - self.candidate_m) <= apart_m + _FASTEST_M_S * abs(stamp_s - self.refused_at)
            self.refused_at = stamp_s
            self.agree, self.candidate_m = self.agree + 1 if again else 1, position_m
            if self.agree < CONFIRMED:
                return False
        self.position_m, self.at, self.agree = position_m, stamp_s, 0
        return True


class Contradiction:
    """Reasons why sensor and drive cannot both be right, from their reports alone.

    - Envelope: the carriage stays within `Envelope.around_m` of the wanted position and the capsule within twice that;
      without a carriage the capsule alone within `around_m`. A magnet keeps its capsule within its gap, so a drifting
      localisation leads it no farther.
    - Sign: a capsule moves where it is pushed. While the push exceeds `_PUSHES` of the greatest one, its readings,
      smoothed by `_MEAN`, go back by less than `_AGAINST`, in m and as a share of the envelope. Waves and recovering
      walls move it less: the magnet pulls harder.
    - Answer: a capsule moves by `_MOVED_M` (or four standard deviations of readings smoothed by `_MEAN`) in the
      direction of the push. A magnet may pull by `_HARD` of its gap for `_PULLED_S` before. The push of a coil beyond
      `_IN_VAIN[0]` times the friction, in frictions, may sum up to `_IN_VAIN[1]` seconds before. With an inner mass it
      moves as far either way within `_ON_S` of swinging.
    - Sight: the reference stays within the envelope while `CONFIRMED` readings come, else a capsule that leaves it is
      seen too late. Jumps of the reference do not count.
    - Speed: readings `_APART_S` apart show less than `_SPEED` of the capsule's limit, so that a drive with unknown
      delay stops before the limit. An inner mass shakes its capsule faster. A coil's capsule
      that breaks away would be stopped too late: `breakaway` limits the push. It slips beyond `_SLIPS`.

    The drive is its own report, in the command's unit; for an inner mass its command. Positions are in m, times in s.
    No method raises, allocates or takes longer with time.
    """

    def __init__(self, envelope: Envelope, noise_m: float, resistance: Resistance = FREE) -> None:
        """`noise_m`: the localisation's deviation."""
        self._envelope, self._noise_m, self._friction = envelope, noise_m, resistance.friction
        full = envelope.gap_m if envelope.placed else envelope.high
        self._push, self._hard_m = _PUSHES * full, _HARD * full
        self._moved_m = max(_MOVED_M, (_SHAKEN_STDS if envelope.shaken else _MEAN_STDS) * noise_m)
        self._against_most_m = min(_AGAINST[0], _AGAINST[1] * envelope.around_m)
        self._fastest_m_s = _SPEED * envelope.limits.speed_m_s + 4 * noise_m / _APART_S
        self.breakaway = Breakaway(resistance, self._fastest_m_s)
        self.begin()

    def begin(self) -> None:
        """Begin anew, with a drive enabled at this moment."""
        around_m, limits, slack_m = self._envelope.around_m, self._envelope.limits, _SLACK_M + _STDS * self._noise_m
        self._drive = Corridor(around_m, limits.carriage_speed_m_s, slack_m)
        self._capsule = Corridor(around_m * (2 if self._envelope.placed else 1), limits.speed_m_s, slack_m)
        self._jump = JumpCheck(self._noise_m)
        self.against_m = self._sign = self._vain_s = self._vain_sign = 0.0
        self._farthest_m = self._mean_m = self._from_m = math.nan
        self._seen_at = self._fast_at = self._fast_m = math.nan
        self._places = deque[tuple[float, float]](maxlen=_PLACES)
        self.breakaway.begin()
        self._outside, self._way_m, self._wanted_m = 0, 0.0, math.nan
        self._ways: deque[float] = deque(maxlen=CONFIRMED)

    def drove(self, drive: float, wanted_m: float, dt: float) -> str:
        """A tick of `dt` s with the drive at `drive`; the reason to stop, or ""."""
        step_m, self._wanted_m = abs(wanted_m - self._wanted_m), wanted_m
        self._way_m += step_m if step_m <= self._envelope.limits.speed_m_s * dt else 0.0
        if len(self._ways) == CONFIRMED and self._way_m - self._ways[0] > self._envelope.around_m:
            far = 1e3 * (self._way_m - self._ways[0])
            return f"the localisation is too slow or late: {CONFIRMED} readings while the reference went {far:.0f} mm"
        if self._in_vain(drive, dt):
            pushed = f"the coil pushed with {abs(drive) / self._friction:.2g} times its friction"
            if self._envelope.placed:
                pushed = f"the magnet pulled by {1e3 * self._hard_m:.1f} mm or more for {_PULLED_S:g} s"
            elif self._envelope.shaken:
                pushed = f"the inner mass swung for {_ON_S:g} s"
            return f"{CONTRADICT}: the capsule does not answer, it has not moved while {pushed}"
        if self._envelope.placed and self._drive.leaves(drive, wanted_m, dt):
            off = 1e3 * (drive - wanted_m)
            return f"{CONTRADICT}: the carriage is {off:+.1f} mm from the wanted position, the capsule not"
        return ""

    def saw(self, position_m: float, drive: float, wanted_m: float, stamp_s: float) -> str:
        """The localisation shows the capsule at `position_m`; `drive` and `wanted_m` are those of its stamp."""
        behind_m = abs(self._wanted_m - wanted_m)
        self._ways.append(self._way_m - (behind_m if behind_m < self._way_m else 0.0))
        if not self._jump.takes(position_m, stamp_s):
            return ""
        push = drive - position_m if self._envelope.placed else self._envelope.sense * drive
        sign = 0.0 if self._envelope.shaken or abs(push) < self._push else math.copysign(1.0, push)
        self._mean_m = position_m if math.isnan(self._mean_m) else self._mean_m + _MEAN * (position_m - self._mean_m)
        if sign != self._sign or sign * (self._mean_m - self._farthest_m) > 0:
            self._sign, self._farthest_m = sign, self._mean_m
        moved_m = self._mean_m - self._from_m
        if not (abs(moved_m) if self._envelope.shaken else self._vain_sign * moved_m) < self._moved_m:  # it answers
            self._from_m, self._vain_s = self._mean_m, 0.0
        self.against_m = sign * (self._farthest_m - self._mean_m)
        dt, self._seen_at = stamp_s - self._seen_at, stamp_s
        slip_m_s = self._slips(position_m, stamp_s)
        self.breakaway.saw(self._places[0][0], stamp_s, self._envelope.sense * slip_m_s)
        if not self._envelope.shaken and (fast_m_s := self._speed(position_m, stamp_s)) > self._fastest_m_s:
            return f"the capsule goes {1e3 * fast_m_s:.0f} mm/s, too near to its limit to be stopped before it"
        if self.against_m > self._against_most_m:
            return f"{CONTRADICT}: the capsule went {1e3 * self.against_m:.1f} mm against the pull of the drive"
        self._outside = self._outside + 1 if self._capsule.leaves(position_m, wanted_m, dt if dt > 0 else 0.0) else 0
        if self._outside >= CONFIRMED:
            off = 1e3 * (position_m - wanted_m)
            beyond = "" if self._envelope.placed else ", beyond limits.envelope_m"
            return f"{CONTRADICT}: the localisation shows the capsule {off:+.1f} mm from the wanted position{beyond}"
        return ""

    def _in_vain(self, drive: float, dt: float) -> bool:
        """Whether the drive has pushed hard, or the inner mass swung, for too long without an answer."""
        placed = self._envelope.placed
        if self._envelope.shaken:
            self._vain_s += dt * (drive > 0)
            return self._vain_s > _ON_S
        push = drive - self._mean_m if placed else self._envelope.sense * drive
        sign = math.copysign(1.0, push) if push else 0.0
        if sign != self._vain_sign:
            self._vain_sign, self._vain_s, self._from_m = sign, 0.0, self._mean_m
        if placed:
            self._vain_s += dt * (abs(push) >= self._hard_m)
            return self._vain_s > _PULLED_S
        least, longest_s = _IN_VAIN
        self._vain_s += dt * max(abs(drive) / self._friction - least, 0.0)
        return self._vain_s > longest_s

    def _slips(self, position_m: float, stamp_s: float) -> float:
        """Velocity in m/s of a capsule that slips, since a reading `_SLIP_APART_S` or longer ago; else 0."""
        while len(self._places) > 1 and stamp_s - self._places[1][0] >= _SLIP_APART_S:
            self._places.popleft()
        self._places.append((stamp_s, position_m))
        since_s, way_m = stamp_s - self._places[0][0], position_m - self._places[0][1]
        least_m = max(_SLIPS[0] * self._envelope.limits.speed_m_s * since_s, math.sqrt(2) * _SLIPS[1] * self._noise_m)
        return way_m / since_s if since_s >= _SLIP_APART_S and abs(way_m) > least_m else 0.0

    def _speed(self, position_m: float, stamp_s: float) -> float:
        """Speed in m/s since a reading `_APART_S` or longer ago, 0 without one."""
        since_s = stamp_s - self._fast_at
        if since_s < _APART_S:
            return 0.0
        fast_m_s = abs(position_m - self._fast_m) / since_s
        self._fast_at, self._fast_m = stamp_s, position_m
        return fast_m_s
