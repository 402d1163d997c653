"""Setpoints of operators: who is in charge, and the reference that follows from the setpoints."""

import math
from collections import Counter
from typing import Any, Final

from controller.reference import SetpointMove, brake, move, rest
from controller.signals import Reference
from hil.bus.codec import Refusal
from hil.bus.protection import COUNTS, Receiver
from hil.nodes.frame_map import frames
from hil.nodes.view import sampled, within
from models.files.toml import check_known
from models.rigs.schema import NamedTable, Words, key

FILLED: Final = 16  # Frames that wait after any pause, however small the bus's queue; a tick on time finds a few


def paused(gap_s: float) -> str:
    return f"controller paused for {gap_s:.2g} s"


def gap_words(gap_s: float, tick_s: float, reports: int, frames: int) -> str:
    """The cause of a step of the clock: a pause if the waiting frames fill the time, else a jump."""
    filled = 2 * reports >= gap_s / tick_s - 1 or frames >= FILLED
    return paused(gap_s) if filled and gap_s > tick_s else "clock jumped"


class Lateness:
    """The delay of a sender's frames. The sender's counter, one more each `cycle_s`, is its clock:
    `late_s = max(0, late_s + dt (1 - drift_share) - n cycle_s)` after dt s in which the counter rose by n. A sender
    slower by `drift_share` looks like a growing delay, and a constant delay is not seen.
    """

    __slots__ = ("_counter", "_cycle_s", "_share", "_stamp", "late_s")

    def __init__(self, cycle_s: float, drift_share: float) -> None:
        self._cycle_s, self._share = cycle_s, drift_share
        self._counter, self._stamp, self.late_s = 0, -math.inf, 0.0

    def heard(self, counter: int, stamp: float, longest_s: float) -> float:
        """`late_s` after the frame received at `stamp` in s; it restarts after a silence of `longest_s`."""
        passed = stamp - self._stamp
        if 0 <= passed <= longest_s:
            counted = (counter - self._counter) % COUNTS * self._cycle_s
            self.late_s = max(self.late_s + passed * (1 - self._share) - counted, 0.0)
        else:
            self.late_s = 0.0
        self._counter, self._stamp = counter, stamp
        return self.late_s


SETPOINT: Final = "OperatorSetpoint"
STATUS: Final = "OperatorStatus"
STATUS_S: Final = 0.05  # period
AHEAD_M: Final = 2e-3  # largest distance of a stopped reference from the estimated position
_REPORTED_S: Final = 0.2  # for which a refusal is reported
RELEASED_S: Final = 0.05  # A pressed switch counts again after a release that lasted this long
_UNREADABLE: Final = ("length", "crc")  # Refusals of a frame of which nothing is used, not even its dead-man switch
NOBODY: Final = 0  # `Source` without an operator
OFF, READY, MOVING, HELD, STOPPED = range(5)  # states of OperatorStatus
_REACH_M, _FASTEST_M_S = 1.1, 0.4  # ranges in the frame


class OperatorLimits(NamedTable):
    """`[operator]`: whether setpoints from the bus are accepted, from which sources, within which limits."""

    where = "operator"
    accept: bool = key("whether the controller accepts setpoints from the bus", False)
    sources: Words = key("sources whose setpoints are accepted, by the names of `OperatorSetpoint`; empty: all", ())
    speed_m_s: float = key("maximum speed of the reference under setpoints", 0.005, 1e-4, _FASTEST_M_S)
    acceleration_m_s2: float = key("maximum acceleration of that reference", 0.05, 1e-3, 10.0)
    lowest_m: float = key("lowest position of that reference, as the localiser measures it", -0.05)
    highest_m: float = key("highest position of that reference", 0.05)
    stop_after_s: float = key("time from a release or a late setpoint to the stop of the drive", 1.0, 0.05, 60.0)
    drift_share: float = key(
        "share by which a sender may be slower than one setpoint per 20 ms: a slower delay is not noticed",
        0.02,
        5e-4,
        1.0,
    )

    def model_post_init(self, _: Any) -> None:
        if not -_REACH_M <= self.lowest_m < self.highest_m <= _REACH_M:
            got = f"{self.lowest_m:g} and {self.highest_m:g}"
            raise ValueError(f"operator.lowest_m must lie below highest_m, both within {_REACH_M:g} m; got {got}")

    def check_sources(self) -> None:
        """Raises ValueError for an unknown source, with the nearest name."""
        known = frames()[SETPOINT].field("Source").names.values()
        check_known(self.sources, known, "operator.sources must be among")


class Operator:
    """Receives OperatorSetpoint frames and makes a reference of them; never raises, takes bounded time.

    One source is in charge: it presses its dead-man switch while no other source is in charge, after a release of
    `RELEASED_S`. Its charge ends when it releases the switch or its setpoint expires. Then the reference stops, and
    after `stop_after_s` the drive is to be stopped (`resting`). A release by the source in charge counts whatever its
    counter. While one node of a source presses the switch, releases by a second node of that source do not arm it.
    `taken`: a source has been in charge since `begin`; from then on a setpoint of speed 0 from any other accepted
    source ends the charge and begins none.

    `refused` counts frames by reason: those of the protection, `source` (not accepted), `busy` (another source is in
    charge), `late` (expired when read; `Lateness` is subtracted from its arrival), `not_released`. `presses` counts
    charges, `expired` those that ended by expiry, `limited` setpoints to an end of the range.
    """

    def __init__(self, limits: OperatorLimits) -> None:
        frame = frames()[SETPOINT]
        source = frame.field("Source")
        self.id, self.limits = frame.id, limits
        self.refused: Counter[str] = Counter()
        self.presses = self.expired = self.limited = 0
        self._shift, self._mask = source.start, (1 << source.length) - 1
        self._receivers = {raw: Receiver(frame) for raw in source.names}
        self._late = {raw: Lateness(frame.cycle_s, limits.drift_share) for raw in source.names}
        self._turn_s = COUNTS * frame.cycle_s
        self._nameless = Receiver(frame)
        names = source.names
        self._accepted = {raw for raw in names if not limits.sources or names[raw] in limits.sources}
        self._reasons = {name: raw for raw, name in frames()[STATUS].field("Refused").names.items()}
        self._speed, self._switch = frame.field("Mode").number("speed"), 1 << frame.field("DeadMan").start
        self._why, self._why_at = 0, -math.inf
        self.begin()

    def begin(self) -> None:
        """Reset: nobody is in charge, and the deployment's reference is in force."""
        self.source, self.taken = NOBODY, False
        self._armed: set[int] = set()
        self._pressed_at: dict[int, float] = {}
        self._at_end = False
        self._dies_at = -math.inf
        self._let_go_at = math.inf
        self._wanted = (0, 0.0, 0.0)
        self._followed: tuple[int, float, float] | None = None

    def accept(self, data: bytes | bytearray, stamp: float, now: float) -> None:
        """Process the frame that arrived at `stamp` and is read at `now`, both in s."""
        bits = int.from_bytes(data, "little")
        source = bits >> self._shift & self._mask
        values = self._receivers.get(source, self._nameless).accept(data, stamp)
        genuine = not isinstance(values, Refusal) or values.reason not in _UNREADABLE
        if genuine and bits & self._switch:
            self._pressed_at[source] = stamp
        elif genuine and source == self.source:
            self._let_go(now)
        if isinstance(values, Refusal):
            self._refuse(values.reason, now)
            return
        receiver = self._receivers[source]
        longest_s = self._turn_s if source == self.source else receiver.longest_s
        late_s = self._late[source].heard(receiver.counter, stamp, longest_s)
        dies_at = stamp - late_s + 1e-3 * values["TimeToLive_ms"]
        if source not in self._accepted:
            self._refuse("source", now)
        elif not values["DeadMan"]:
            if stamp - self._pressed_at.get(source, -math.inf) >= RELEASED_S:
                self._armed.add(source)
        elif not stamp <= now <= dies_at:
            self._refuse("late", now)
        elif self.taken and source != self.source and int(values["Mode"]) == self._speed and not values["Velocity_m_s"]:
            if self.source != NOBODY:
                self._let_go(now)
        elif self.source not in (NOBODY, source):
            self._armed.discard(source)
            self._refuse("busy", now)
        elif source not in self._armed:
            self._refuse("not_released", now)
        else:
            self.presses += self.source == NOBODY
            self.source, self.taken = source, True
            self._dies_at = dies_at
            self._wanted = (int(values["Mode"]), values["Position_m"], values["Velocity_m_s"])

    def expire(self, now: float) -> None:
        if self.source != NOBODY and not now <= self._dies_at:
            self.expired += 1
            self._let_go(now)

    @property
    def let_go(self) -> bool:
        """Whether the last charge has ended: a disabled drive then stays disabled."""
        return self.taken and self.source == NOBODY

    def resting(self, now: float) -> bool:
        """Whether the drive is to be stopped because nobody has been in charge for `stop_after_s`."""
        return self.let_go and now - self._let_go_at >= self.limits.stop_after_s

    def enabled(self, position_m: float) -> Reference:
        """The reference when the drive is enabled, the capsule is at `position_m`, and a source has taken charge."""
        self._followed = None
        return rest(position_m)

    def follow(self, now: float, reference: Reference, position_m: float) -> Reference:
        """The reference from `now` on; the same object if nothing has changed."""
        if not self.taken:
            return reference
        wanted = self._wanted if self.source != NOBODY else None
        if wanted != self._followed or not isinstance(reference, SetpointMove):
            self._followed = wanted
            here, speed = sampled(reference, now)
            if wanted is None:
                near = math.isfinite(position_m)
                reference = rest(min(max(here, position_m - AHEAD_M), position_m + AHEAD_M) if near else here)
            else:
                reference = self._move(wanted, here, speed, now)
        before, self._at_end = self._at_end, wanted is not None and self._beyond(wanted) and now >= reference.times[-1]
        self.limited += self._at_end and not before
        return reference

    def status(self, now: float, reference: Reference, leading: bool) -> dict[str, float]:
        here, speed = sampled(reference, now)
        moves = self.source != NOBODY and isinstance(reference, SetpointMove) and now < reference.times[-1]
        state = STOPPED if self.resting(now) else MOVING if moves else HELD if self.taken else READY
        why = self._why if 0 <= now - self._why_at <= _REPORTED_S else 0
        return {
            "State": state if leading else OFF,
            "Source": self.source,
            "Refused": self._reasons["range"] if self._at_end and leading else why,
            "Position_m": within(here, _REACH_M),
            "Velocity_m_s": within(speed, _FASTEST_M_S),
        }

    def document(self) -> dict[str, object]:
        accepted = sum(receiver.accepted for receiver in self._receivers.values())
        refused = {"accepted": accepted, "refused": dict(self.refused)}
        return {"presses": self.presses, "expired": self.expired, "limited": self.limited, **refused}

    def _move(self, wanted: tuple[int, float, float], here: float, speed: float, now: float) -> SetpointMove:
        mode, position, velocity = wanted
        limits = self.limits
        stops = here + speed * abs(speed) / (2 * limits.acceleration_m_s2)
        low, high = min(limits.lowest_m, here, stops), max(limits.highest_m, here, stops)
        fastest = min(abs(velocity), limits.speed_m_s)
        if mode == self._speed and not fastest:
            return brake(here, speed, limits.acceleration_m_s2, now)
        end = high if velocity > 0 else low
        goal = end if mode == self._speed else min(max(position, low), high)
        return move(goal, here, speed, fastest or limits.speed_m_s, limits.acceleration_m_s2, now)

    def _beyond(self, wanted: tuple[int, float, float]) -> bool:
        """Whether a setpoint would leave the range from a reference that has stopped."""
        mode, position, velocity = wanted
        return velocity != 0.0 if mode == self._speed else not self.limits.lowest_m <= position <= self.limits.highest_m

    def _let_go(self, now: float) -> None:
        self._armed.discard(self.source)
        self.source, self._let_go_at = NOBODY, now

    def _refuse(self, reason: str, now: float) -> None:
        self.refused[reason] += 1
        self._why, self._why_at = self._reasons.get(reason, 0), now
