"""The table `[[faults]]`: kind, time, duration and target of each fault."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from controller.drives import CARRIAGE, INNER_MASS
from models.parameter import nearest
from models.rigs.schema import from_table

LINKS: Final = ("commands", "feedback", "localisation", "all")
SENSORS: Final = ("localisation", "feedback")
NODES: Final = ("controller", "drive", "localiser")
SETPOINTS: Final = "setpoints"  # the link from the operator to the controller
_LINKS: Final = (*LINKS, SETPOINTS)
_KEYED: Final = LINKS[:3]
DRIVE: Final = "drive"  # the true motion of the drive, while its report follows the command
_VALUES: Final = (*SENSORS, DRIVE)
MAKER, OPERATOR, KEY = "maker", "operator", "key"
"""Requirements of a fault on its scenario: a drive of another maker, an operator, an authenticated bus."""
_SHARE: Final = (1e-6, 1.0)  # least and most


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault: its effect, targets, the meaning of its `value`, its requirement, and the rigs that have it."""

    summary: str
    targets: tuple[str, ...] = ("",)
    value: float = math.nan
    meaning: str = ""
    range: tuple[float, float] = (-math.inf, math.inf)
    needs: str = ""
    rigs: tuple[str, ...] = ()


_OTHER_RIG: Final = (CARRIAGE.name, INNER_MASS.name)
_OWN_UNIT: Final = "m/s, A, or share of the level"
LIES: Mapping[str, FaultKind] = {
    "drift": FaultKind("the value drifts at a constant rate", SENSORS, 0.005, "m/s or A/s", (-0.1, 0.1)),
    "jumped": FaultKind("the value has a constant error from one moment on", SENSORS[:1], 0.004, "m", (-0.1, 0.1)),
    "sway": FaultKind("the error is a sine with a period of 8 s", SENSORS[:1], 0.01, "m", (-0.1, 0.1)),
    "flipped": FaultKind("the value has the wrong sign", SENSORS),
    "turned": FaultKind("changes since the begin have the wrong sign", _VALUES),
    "scaled": FaultKind("changes since the begin have the wrong scale", _VALUES, 2.0, "times", (0.0, 10.0)),
    "held": FaultKind(
        "the value is constant, or `value`; a localiser's with its noise",
        _VALUES,
        meaning="m, A, or share of the level",
        range=(-5.0, 5.0),
    ),
    "late": FaultKind("readings are late and state their age", SENSORS[:1], 0.12, "s", (1e-3, 0.4)),
    "late_unsaid": FaultKind("readings are late and claim to be fresh", SENSORS[:1], 0.12, "s", (1e-3, 0.4)),
    "swapped": FaultKind("the position is that of carriage or inner mass", SENSORS[:1], rigs=_OTHER_RIG),
    "foreign": FaultKind("the position is a smooth motion of another rig", SENSORS[:1], 0.01, "m", (1e-4, 0.5)),
    "noisy": FaultKind("the noise is larger", SENSORS[:1], 10.0, "times", (1.0, 100.0)),
    "coarse": FaultKind("the value has coarse steps", SENSORS[:1], 0.002, "m", (1e-6, 0.1)),
    "sticks": FaultKind("the carriage lags and jumps", (DRIVE,), 0.005, "m", (1e-5, 0.1), rigs=_OTHER_RIG[:1]),
    "restless": FaultKind("the disabled drive moves, and reports it", (DRIVE,), 0.02, _OWN_UNIT, (-2.0, 2.0)),
}
"""Frames that are valid but false, and drives that move without or against their commands."""
KINDS: Mapping[str, FaultKind] = {
    "drop": FaultKind("frames are lost", _LINKS, 1.0, "share of the frames", _SHARE),
    "delay": FaultKind("frames are late", _LINKS, 0.03, "s", (1e-4, 10.0)),
    "duplicate": FaultKind("frames come twice", _LINKS),
    "reorder": FaultKind("pairs of frames are swapped", _LINKS),
    "corrupt": FaultKind("bits are flipped behind the bus's own check", _LINKS, 1.0, "share of the frames", _SHARE),
    "replay": FaultKind("old frames are repeated between the true ones", _LINKS, 20.0, "frames ago", (1, 32)),
    "retyped": FaultKind("frames become extended, remote, error and FD frames (FD: classic) in turn", _LINKS),
    "unreadable": FaultKind("the node's interface raises at each reading", NODES[:2]),
    "second_master": FaultKind("another controller sends SYNC, heartbeat and commands that enable"),
    "player": FaultKind("all frames of the controller since the run began are played back"),
    "babbling": FaultKind("a node sends identifier 0, the highest priority, without pause"),
    "bus_off": FaultKind("a node goes bus-off", NODES),
    "stuck": FaultKind("the sensor repeats its last value", SENSORS),
    "biased": FaultKind("the sensor has a bias", SENSORS, 0.01, "m or A", (-1.0, 1.0)),
    "nan": FaultKind("the sensor's value is nan", SENSORS[:1]),
    "lost": FaultKind("the localiser is silent", SENSORS[:1]),
    "over_temperature": FaultKind("the drive gets hot", value=60.0, meaning="degC", range=(-40.0, 150.0)),
    "drive_reset": FaultKind("the drive reboots"),
    "encoder_error": FaultKind("the drive's encoder has no value", needs=MAKER),
    "wrong_node": FaultKind("the drive has another node number", needs=MAKER),
    "wrong_bit_rate": FaultKind("the drive has another bit rate", needs=MAKER),
    "killed": FaultKind("the controller's process is killed"),
    "frozen": FaultKind("the controller's process is stopped"),
    "late_solve": FaultKind("the controller's solutions are late"),
    "released": FaultKind("the operator releases the dead-man switch for good", needs=OPERATOR),
    "held_back": FaultKind(
        "a gateway delays each setpoint longer than the last", (SETPOINTS,), 0.01, "s longer", (1e-4, 10.0), OPERATOR
    ),
    "frozen_setpoint": FaultKind("the operator's node repeats one frame", (SETPOINTS,), needs=OPERATOR),
    "miscounted": FaultKind("counters of setpoints are wrong by 8, with a good CRC", (SETPOINTS,), needs=OPERATOR),
    "out_of_range": FaultKind("positions of setpoints are out of range", (SETPOINTS,), needs=OPERATOR),
    "beyond_limits": FaultKind("setpoints command 0.4 m/s", (SETPOINTS,), needs=OPERATOR),
    "second_operator": FaultKind(
        "a second operator, with another or the same source", ("other", "same"), needs=OPERATOR
    ),
    "forged": FaultKind("frames have a wrong authenticator", _KEYED, needs=KEY),
    "wrong_key": FaultKind("frames are authenticated with another key", _KEYED, needs=KEY),
    "recorded": FaultKind("recorded genuine frames, whose counters fit, replace the true ones", _KEYED, needs=KEY),
    "unkeyed": FaultKind("frames are classic ones without an authenticator", _KEYED, needs=KEY),
    "epoch_back": FaultKind("the sender restarts with an earlier epoch", _KEYED, needs=KEY),
    "clock_jump": FaultKind("the controller's clock jumps", value=0.5, meaning="s", range=(-1000.0, 1000.0)),
    **LIES,
}


@dataclass(frozen=True)
class Fault:
    """One fault; by default a lie lasts for ever and any other fault for 0.2 s. A drift grows to `size_m`."""

    kind: str
    at_s: float
    duration_s: float = math.nan
    target: str = ""
    value: float = math.nan
    size_m: float = math.nan

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            nearest_kind = nearest(self.kind, KINDS)
            raise ValueError(f"faults.kind must be one of {', '.join(KINDS)}; got {self.kind!r}; {nearest_kind}")
        known = KINDS[self.kind]
        choices = ", ".join(target for target in known.targets if target)
        wanted = f"one of {choices}" if choices else "left out"
        self._must("target", not self.target or self.target in known.targets, wanted, repr(self.target))
        if not 0 <= self.at_s < math.inf:
            raise ValueError(f"faults.at_s must be zero or more; got {self.at_s:g}")
        if math.isnan(self.duration_s):
            object.__setattr__(self, "duration_s", math.inf if self.kind in LIES else 0.2)
        if not self.duration_s > 0:
            raise ValueError(f"faults.duration_s must be positive; got {self.duration_s:g}")
        fine = math.isnan(self.value) or (known.meaning and math.isfinite(self.value))
        self._must("value", fine, f"a number ({known.meaning})" if known.meaning else "left out", f"{self.value:g}")
        least, most = known.range
        if known.meaning and not (math.isnan(self.amount) or least <= self.amount <= most):
            limits = f"[{least:g}, {most:g}] ({known.meaning})"
            raise ValueError(f"faults.value of {self.kind} must lie in {limits}; got {self.value:g}")
        fine = self.kind != "replay" or self.amount == int(self.amount)
        self._must("value", fine, "a whole number of frames", f"{self.value:g}")
        fine = math.isnan(self.size_m) or (self.kind == "drift" and 0 < self.size_m < math.inf)
        wanted = "a positive number of m" if self.kind == "drift" else "left out"
        self._must("size_m", fine, wanted, f"{self.size_m:g}")
        object.__setattr__(self, "target", self.target or known.targets[0])

    def _must(self, key: str, fine: object, wanted: str, got: str) -> None:
        if not fine:
            raise ValueError(f"faults.{key} of {self.kind} must be {wanted}; got {got}")

    @property
    def amount(self) -> float:
        return KINDS[self.kind].value if math.isnan(self.value) else self.value

    @property
    def needs(self) -> str:
        return OPERATOR if self.target == SETPOINTS else KINDS[self.kind].needs

    def check_rig(self, kind: str) -> None:
        """Raises ValueError for a `kind` of rig without this fault."""
        rigs = KINDS[self.kind].rigs
        if rigs and kind not in rigs:
            raise ValueError(f"faults.kind {self.name} must stand with rig.kind {' or '.join(rigs)}; got {kind!r}")

    @property
    def end_s(self) -> float:
        return self.at_s + self.duration_s

    @property
    def name(self) -> str:
        return f"{self.kind} {self.target}".strip()


def read_faults(tables: Any, duration_s: float) -> tuple[Fault, ...]:
    """The faults of a scenario in order of time. Raises ValueError of one sentence that names the key."""
    if not isinstance(tables, Sequence) or isinstance(tables, str) or not all(isinstance(t, Mapping) for t in tables):
        raise ValueError(f"faults must be tables [[faults]]; got {tables!r}")
    found = sorted((from_table(Fault, t, "faults") for t in tables), key=lambda f: f.at_s)
    for fault in found:
        if fault.at_s >= duration_s:
            raise ValueError(f"faults.at_s must lie within the run of {duration_s:g} s; got {fault.at_s:g}")
    return tuple(found)


def read_lie(text: str) -> Fault:
    """The lie typed as `KIND[:TARGET][=VALUE][@AT_S]`. Raises ValueError for other text."""
    found = re.fullmatch(r"(\w+)(?::(\w+))?(?:=([^@]+))?(?:@(.+))?", text)
    try:
        kind, target, value, at_s = found.groups() if found else ("", "", "", "")
        if kind not in LIES:
            raise ValueError(f"the kind must be one of {', '.join(LIES)}; {nearest(kind, LIES)}")
        return Fault(kind, float(at_s or 0.0), math.inf, target or "", float(value) if value else math.nan)
    except ValueError as error:
        raise ValueError(f"--lie must be KIND[:TARGET][=VALUE][@AT_S], of a lie; got {text!r}: {error}") from None
