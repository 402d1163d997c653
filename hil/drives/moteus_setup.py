"""Sets a moteus controller up over CAN FD. Source: the maker's reference of registers and configuration."""

import math
import time
from typing import Final

import can

from controller.limits import Limits
from hil.drives import moteus_protocol as wire
from hil.drives.moteus_protocol import MoteusTable
from hil.drives.table import Questions

HOLD_POSITION: Final = wire.POSITION_MODE  # servo.timeout_mode of this name
BRAKING_MODES: Final = (HOLD_POSITION, wire.ZERO_VELOCITY, wire.BRAKE)
"""Values of servo.timeout_mode that brake: hold position, zero velocity, phases shorted."""
LONGEST_S: Final = 0.1  # servo.default_timeout_s as shipped: the longest life of a command without its own watchdog
RESTS_M_S, RESTS_TURNS_S = 0.01, 0.1  # measured speed at rest, at most the larger of both
FARTHEST_TURNS: Final = 32768.0  # where the position wraps around
_MOST_POLLS: Final = 100  # to empty a stream
_HOMES: Final = {wire.RELATIVE: "relative only", wire.ROTOR: "rotor, which is within one of its turns"}


def set_up(
    bus: can.BusABC, table: MoteusTable, limits: Limits, tick_s: float = math.nan, *, faulty: bool = False
) -> list[str]:
    """See `hil.drives.makers.Maker`. Writes watchdog, no limits, and the can.prefix of a session; the saved
    configuration is only read. A fault is left to the operator, and nothing is written then.
    """
    ask = MoteusQuestions(bus, table)
    found = ask.values(wire.QUERY + wire.read(wire.HOME_STATE))
    mode = found[wire.MODE]
    stopped = mode in (wire.STOPPED, wire.FAULTED, wire.TIMED_OUT)
    table.must(stopped, f"be stopped before the run; got mode {mode:g}, set by another master")
    _stops(table, ask)
    _obeys(table, limits, ask)
    if mode != wire.STOPPED:
        return []
    _rests_where_known(table, limits, found)
    _takes(table, ask)
    late = f"{table.node} does not take can.prefix: after a reset it obeys late commands"
    return [] if ask.begin_session() else [late]


def _stops(table: MoteusTable, ask: "MoteusQuestions") -> None:
    default, mode = ask.setting("servo.default_timeout_s"), ask.setting("servo.timeout_mode")
    fine = not math.isnan(default)
    table.must(fine, "have a watchdog of its own (servo.default_timeout_s); got nan, which is none")
    fine = 0 < default <= LONGEST_S * 1.001
    table.must(fine, f"have servo.default_timeout_s in (0, {LONGEST_S:g}] s; got {default:g}")
    choices = ", ".join(map(str, BRAKING_MODES))
    words = f"brake once its watchdog expires: servo.timeout_mode must be one of {choices}; got {mode:g}"
    table.must(mode in BRAKING_MODES, words)
    if mode == HOLD_POSITION:
        limit, least = ask.setting("servo.default_accel_limit", math.nan), table.coast_m_s2 * abs(table.turns_per_m)
        table.must(
            not limit < least,
            f"brake with servo.default_accel_limit once its watchdog expires (servo.timeout_mode 10): it must be nan or"
            f" at least {least:g} turns/s2, moteus.coast_m_s2 at its output, or servo.timeout_mode 12; got {limit:g}",
        )


def _obeys(table: MoteusTable, limits: Limits, ask: "MoteusQuestions") -> None:
    words = "measure where it is: servo.fixed_voltage_mode must be 0; got 1, which reports the commanded position"
    table.must(not ask.setting("servo.fixed_voltage_mode", 0.0), words)
    table.must(
        not ask.setting("servo.bemf_feedforward", 0.0) or bool(ask.setting("servo.bemf_feedforward_override", 0.0)),
        "take commands without a limit of acceleration (fault 47): servo.bemf_feedforward must be 0, or"
        " servo.bemf_feedforward_override 1",
    )
    fastest, farthest = (abs(table.turns_per_m) * most for most in (limits.carriage_speed_m_s, limits.travel_m))
    words = f"reach limits.carriage_speed_m_s: servo.max_velocity must be at least {fastest:g} turns/s"
    table.must(not ask.setting("servo.max_velocity", math.inf) < fastest, words)
    words = f"reach limits.travel_m within {FARTHEST_TURNS:g} turns, where its position wraps around; got {farthest:g}"
    table.must(farthest <= FARTHEST_TURNS, words)


def _rests_where_known(table: MoteusTable, limits: Limits, found: dict[int, float]) -> None:
    scale, home, kept = abs(table.turns_per_m), int(found.get(wire.HOME_STATE, 0.0)), table.home == "kept"
    table.must(
        not kept or home == wire.OUTPUT,
        f"know its position at the output (home state 2); got {_HOMES.get(home, f'{home}')}: give it an encoder there"
        " (motor_position.output.reference_source), set its position after each power-on ('d nearest', 'd exact'), or"
        " take its present position as zero with moteus.home = 'here'",
    )
    position_m, speed_m_s = (found.get(number, math.nan) / scale for number in (wire.POSITION, wire.VELOCITY))
    table.must(math.isfinite(position_m), "measure where it is; got position nan")
    words = f"stand within limits.travel_m of its zero, {limits.travel_m:g} m; got {position_m:g}"
    table.must(not kept or abs(position_m) <= limits.travel_m, words)
    table.must_rest(speed_m_s, f"got {speed_m_s:g} m/s", max(RESTS_M_S, RESTS_TURNS_S / scale))


def _takes(table: MoteusTable, ask: "MoteusQuestions") -> None:
    """Write and read back its zero (for home "here"), the watchdog, and no limits."""
    if table.home == "here":
        ask.values(wire.write(wire.SET_OUTPUT_EXACT, (0.0,)) + wire.QUERY)
        home = ask.values(wire.QUERY + wire.read(wire.HOME_STATE)).get(wire.HOME_STATE, 0.0)
        words = f"take its present position as zero (register 0x131, home state 2); got {home:g}"
        table.must(home == wire.OUTPUT, words)
    got = ask.values(wire.mode_write(wire.STOPPED) + wire.hold(table.watchdog_s) + wire.QUERY)
    for register, wanted, absent, what, unit in (
        (wire.WATCHDOG_TIMEOUT, table.watchdog_s, math.nan, "the watchdog of", " s"),
        (wire.VELOCITY_LIMIT, wire.UNLIMITED, wire.UNLIMITED, "the limit", ""),
        (wire.ACCELERATION_LIMIT, wire.UNLIMITED, wire.UNLIMITED, "the limit", ""),
    ):
        value = got.get(register, absent)
        fine = math.isclose(value, wanted, rel_tol=1e-6)
        table.must(fine, f"hold {what} {wanted:g}{unit} (register {register:#05x}); it holds {value:g}")


class MoteusQuestions(Questions):
    """Queries of registers and of the diagnostic stream, by the drive's own can.prefix or that of a session."""

    def __init__(self, bus: can.BusABC, table: MoteusTable) -> None:
        super().__init__(bus, table, wire.replier)
        self._id, self._answers_s, self._prefix = table.node_id, table.answers_s, 0

    def values(self, data: bytes) -> dict[int, float]:
        """The registers in the drive's reply, queried with both prefixes in turn."""
        self._prefix = wire.SESSION - self._prefix

        def question() -> can.Message:
            self._prefix = wire.SESSION - self._prefix
            return wire.frame_to(self._id, data, self._prefix)

        found = self.answer(question, lambda message: wire.MODE in wire.reported(bytes(message.data)))
        if found is not None:
            return wire.reported(bytes(found.data))
        self.send(wire.frame_to(wire.BROADCAST, wire.QUERY))
        next(self.heard(0.2), None)
        causes = "both bit rates, sample points, termination", "supply, wiring, bit rates 1 and 5 Mbit/s, can.prefix 0"
        raise self.silent(*causes)

    def setting(self, name: str, absent: float | None = None) -> float:
        """A value of its configuration; `absent` if its firmware does not have that name."""
        self._drain()
        self._reply(wire.stream(f"conf get {name}"), 0.05)
        text, end = b"", time.monotonic() + self._answers_s
        while not text.endswith(b"\n"):
            if time.monotonic() > end:
                raise ValueError(f"{self.node} must report {name} over its diagnostic stream")
            text += self._poll()
        words = " ".join(text.decode("ascii", "replace").split())
        try:
            return float(words.split()[-1])
        except (ValueError, IndexError):
            if absent is not None and words.startswith("ERR"):
                return absent
            raise ValueError(f"{self.node} must report {name} as a number; got {words!r}") from None

    def begin_session(self) -> bool:
        """Set the can.prefix of a session; whether the drive took it."""
        if self._prefix != wire.SESSION:
            self._drain()
            self._reply(wire.stream(f"conf set can.prefix {wire.SESSION}"), 0.05)
            self._prefix = wire.SESSION
            if not any(wire.reported(self._reply(wire.QUERY, 0.1)) for _ in range(3)):
                self._prefix = 0
            self._drain()
        return self._prefix == wire.SESSION

    def _drain(self) -> None:
        for _ in range(_MOST_POLLS):
            if not self._poll():
                return

    def _poll(self) -> bytes:
        """The next bytes of the stream, at most 48."""
        data = self._reply(bytes((wire.STREAM_POLL, 1, 48)), 0.05)
        return data[3 : 3 + data[2]] if len(data) >= 3 and data[:2] == bytes((wire.STREAM_FROM_SERVO, 1)) else b""

    def _reply(self, data: bytes, seconds: float) -> bytes:
        """The next reply within `seconds`, empty without one."""
        self.send(wire.frame_to(self._id, data, self._prefix))
        found = next(self.heard(seconds), None)
        return b"" if found is None else bytes(found.data)
