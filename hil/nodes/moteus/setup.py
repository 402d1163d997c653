"""Sets a moteus controller up over CAN FD: found, asked what it does without commands, and refused where the carriage
would not come to rest as stated. Source: the maker's reference of registers and configuration.
"""

from __future__ import annotations

import math
import time
from typing import Final

import can

from controller.limits import Limits
from hil.nodes.listening import heard_for, silent
from hil.nodes.moteus import registers as wire
from hil.nodes.moteus.table import MoteusTable

HOLD_POSITION: Final = 10  # servo.timeout_mode of this name
BRAKING_MODES: Final = (HOLD_POSITION, 12, 15)
"""Values of servo.timeout_mode by which it brakes: hold position, zero velocity, phases shorted."""
LONGEST_S: Final = 0.1
"""As servo.default_timeout_s is shipped: a command that has lost its own watchdog lives no longer."""
RESTS_M_S, RESTS_TURNS_S = 0.01, 0.1
"""What it may tell as its speed at rest, the larger of both."""
FARTHEST_TURNS: Final = 32768.0  # where a place begins anew
_MOST_POLLS: Final = 100  # that a stream is let go with
_HOMES: Final = {wire.RELATIVE: "relative only", wire.ROTOR: "rotor, which is within one of its turns"}


def set_up(bus: can.BusABC, table: MoteusTable, limits: Limits | None = None) -> list[str]:
    """Find the drive, read back what it does without commands, let it take the watchdog and no limits, and give it the
    can.prefix of a session; it stays stopped. Blocks, at most some seconds. What it saves is only read. A fault stays
    for the operator to acknowledge, and nothing is written then. Gives a sentence for what it does not do that one may
    do without.

    Raises ValueError of one sentence where no drive answers or it is not as it must be.
    """
    ask, node = _Questions(bus, table), f"moteus: node {table.node_id}"
    found = ask.values(wire.QUERY + wire.read(wire.HOME_STATE))
    mode = found[wire.MODE]
    if mode not in (wire.STOPPED, wire.FAULTED, wire.TIMED_OUT):
        raise ValueError(f"{node} must be stopped before it is led; got mode {mode:g}, by somebody else")
    _must_stop(node, table, ask)
    _must_obey(node, table, limits or Limits(), ask)
    if mode != wire.STOPPED:
        return []
    _must_rest_where_known(node, table, limits or Limits(), found)
    if table.home == "here":
        _make_zero(node, ask)
    taken = ask.values(wire.mode_write(wire.STOPPED) + wire.hold(table.watchdog_s) + wire.QUERY)
    _must_hold(node, wire.WATCHDOG_TIMEOUT, table.watchdog_s, taken.get(wire.WATCHDOG_TIMEOUT, math.nan))
    for register in (wire.VELOCITY_LIMIT, wire.ACCELERATION_LIMIT):
        _must_hold(node, register, wire.UNLIMITED, taken.get(register, wire.UNLIMITED))
    return [] if ask.begin_session() else [f"{node} does not take can.prefix: after a reset it obeys late commands"]


def _must_rest_where_known(node: str, table: MoteusTable, limits: Limits, found: dict[int, float]) -> None:
    scale, home = abs(table.turns_per_m), int(found.get(wire.HOME_STATE, 0.0))
    if table.home == "kept" and home != wire.OUTPUT:
        raise ValueError(
            f"{node} must know its place at the output (home state 2); got {_HOMES.get(home, f'{home}')}: let it have"
            " an encoder there (motor_position.output.reference_source) or be told ('d nearest', 'd exact') each time"
            " it is switched on, or moteus.home = 'here' makes the present place zero"
        )
    place_m, speed_m_s = (found.get(number, math.nan) / scale for number in (wire.POSITION, wire.VELOCITY))
    if not math.isfinite(place_m):
        raise ValueError(f"{node} must measure where it is; got position nan")
    if table.home == "kept" and abs(place_m) > limits.travel_m:
        raise ValueError(
            f"{node} must stand within limits.travel_m of its zero, {limits.travel_m:g} m; got {place_m:g}"
        )
    if not abs(speed_m_s) <= max(RESTS_M_S, RESTS_TURNS_S / scale):
        raise ValueError(f"{node} must rest before it is led; got {speed_m_s:g} m/s")


def _must_stop(node: str, table: MoteusTable, ask: _Questions) -> None:
    """As `stops_s` states, once nothing comes any more."""
    default, mode = ask.setting("servo.default_timeout_s"), ask.setting("servo.timeout_mode")
    if math.isnan(default):
        raise ValueError(f"{node} must have a watchdog of its own (servo.default_timeout_s); got nan, which is none")
    if not 0 < default <= LONGEST_S * 1.001:
        raise ValueError(f"{node} must have servo.default_timeout_s in (0, {LONGEST_S:g}] s; got {default:g}")
    if mode not in BRAKING_MODES:
        raise ValueError(
            f"{node} must brake once its watchdog expires: servo.timeout_mode must be one of"
            f" {', '.join(map(str, BRAKING_MODES))}; got {mode:g}"
        )
    if mode == HOLD_POSITION:
        limit, least = ask.setting("servo.default_accel_limit", math.nan), table.coast_turns_s2
        if not math.isnan(limit) and limit < least:
            raise ValueError(
                f"{node} must brake with servo.default_accel_limit once its watchdog expires (servo.timeout_mode 10):"
                f" it must be nan or at least {least:g} turns/s2, moteus.coast_m_s2 at its output, or"
                f" servo.timeout_mode 12; got {limit:g}"
            )


def _must_obey(node: str, table: MoteusTable, limits: Limits, ask: _Questions) -> None:
    """The places that it is told, by what it measures."""
    if ask.setting("servo.fixed_voltage_mode", 0.0):
        raise ValueError(
            f"{node} must measure where it is: servo.fixed_voltage_mode must be 0; got 1, which tells the place that"
            " it is told"
        )
    if ask.setting("servo.bemf_feedforward", 0.0) and not ask.setting("servo.bemf_feedforward_override", 0.0):
        raise ValueError(
            f"{node} must take commands without a limit of acceleration (fault 47): servo.bemf_feedforward must be 0,"
            " or servo.bemf_feedforward_override 1"
        )
    fastest, farthest = (abs(table.turns_per_m) * most for most in (limits.carriage_speed_m_s, limits.travel_m))
    if ask.setting("servo.max_velocity", math.inf) < fastest:
        raise ValueError(
            f"{node} must reach limits.carriage_speed_m_s: servo.max_velocity must be at least {fastest:g} turns/s"
        )
    if farthest > FARTHEST_TURNS:
        raise ValueError(
            f"{node} must reach limits.travel_m within {FARTHEST_TURNS:g} turns, where its place begins anew; got"
            f" {farthest:g}"
        )


def _make_zero(node: str, ask: _Questions) -> None:
    ask.values(wire.write(wire.SET_OUTPUT_EXACT, (0.0,)) + wire.QUERY)
    home = ask.values(wire.QUERY + wire.read(wire.HOME_STATE)).get(wire.HOME_STATE, 0.0)
    if home != wire.OUTPUT:
        raise ValueError(f"{node} must take the present place for zero (register 0x131, home state 2); got {home:g}")


def _must_hold(node: str, register: int, wanted: float, held: float) -> None:
    what = "the watchdog of" if register == wire.WATCHDOG_TIMEOUT else "the limit"
    unit = " s" if register == wire.WATCHDOG_TIMEOUT else ""
    if not math.isclose(held, wanted, rel_tol=1e-6):
        raise ValueError(f"{node} must hold {what} {wanted:g}{unit} (register {register:#05x}); it holds {held:g}")


class _Questions:
    """Questions to the drive and its answers, before the controller listens."""

    def __init__(self, bus: can.BusABC, table: MoteusTable) -> None:
        self._bus, self._table, self._prefix = bus, table, 0
        self._errors, self._others = 0, set[int]()

    def values(self, data: bytes) -> dict[int, float]:
        """The registers that the drive tells, asked for again each 0.1 s, by its own prefix and a session's in turn."""
        end = time.monotonic() + self._table.answers_s
        while time.monotonic() < end:
            found = wire.told(self._reply(data, 0.1))
            if wire.MODE in found:
                return found
            self._prefix = wire.SESSION - self._prefix
        raise self._silent()

    def setting(self, name: str, absent: float | None = None) -> float:
        """A value of its configuration, over its diagnostic stream; `absent` where its firmware has none of that
        name.
        """
        words = self._line(f"conf get {name}", name)
        try:
            return float(words.split()[-1])
        except (ValueError, IndexError):
            if absent is not None and words.startswith("ERR"):
                return absent
            raise ValueError(
                f"moteus: node {self._table.node_id} must tell {name} as a number; got {words!r}"
            ) from None

    def begin_session(self) -> bool:
        """Give it the can.prefix of a session; whether it has it."""
        if self._prefix != wire.SESSION:
            self._drain()
            self._reply(wire.stream(f"conf set can.prefix {wire.SESSION}"), 0.05)
            self._prefix = wire.SESSION
            if not any(wire.told(self._reply(wire.QUERY, 0.1)) for _ in range(3)):
                self._prefix = 0
            self._drain()
        return self._prefix == wire.SESSION

    def _line(self, line: str, name: str) -> str:
        """What its diagnostic stream answers to `line`, in one line."""
        self._drain()
        self._reply(wire.stream(line), 0.05)
        text, end = b"", time.monotonic() + self._table.answers_s
        while not text.endswith(b"\n"):
            if time.monotonic() > end:
                raise ValueError(f"moteus: node {self._table.node_id} must tell {name} over its diagnostic stream")
            text += self._poll()
        return " ".join(text.decode("ascii", "replace").split())

    def _drain(self) -> None:
        """Let go what its stream has, where that ends at all."""
        for _ in range(_MOST_POLLS):
            if not self._poll():
                return

    def _poll(self) -> bytes:
        """What the stream has, at most 48 bytes."""
        data = self._reply(bytes((wire.STREAM_POLL, 1, 48)), 0.05)
        return data[3 : 3 + data[2]] if len(data) >= 3 and data[:2] == bytes((wire.STREAM_FROM_SERVO, 1)) else b""

    def _silent(self) -> ValueError:
        """That nobody answers, and who does instead."""
        self._prefix = 0
        self._reply(wire.QUERY, 0.2, wire.BROADCAST)
        causes = "both bit rates, sample points, termination", "supply, wiring, bit rates 1 and 5 Mbit/s, can.prefix 0"
        node = f"moteus: node {self._table.node_id}"
        return silent(node, self._table.answers_s, self._others, self._errors, causes)

    def _reply(self, data: bytes, seconds: float, node: int = 0) -> bytes:
        """The next reply within `seconds`, empty where there is none; what came before is let go."""
        try:
            while self._bus.recv(0) is not None:
                pass
            self._bus.send(wire.frame_to(node or self._table.node_id, data, self._prefix), timeout=0.1)
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            raise ValueError(f"moteus: node {self._table.node_id} must be reached; got: {error}") from None
        for message in heard_for(self._bus, seconds):
            self._errors += message.is_error_frame
            speaker = wire.replier(message)
            if speaker == self._table.node_id:
                return bytes(message.data)
            if speaker > 0:
                self._others.add(speaker)
        return b""
