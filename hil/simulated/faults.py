"""The table `[[faults]]`: what shall go wrong, when, for how long, and where."""

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
SETPOINTS: Final = "setpoints"  # the way from the operator to the controller
_WAYS: Final = (*LINKS, SETPOINTS)
_KEYED: Final = LINKS[:3]
DRIVE: Final = "drive"  # what the drive truly does, while its report follows the command as a sound one's would
_TOLD: Final = (*SENSORS, DRIVE)
MAKER, OPERATOR, KEY = "maker", "operator", "key"
"""What a scenario must have beside a fault: another maker's drive, somebody who steers, an authenticated bus."""
_SHARE: Final = (1e-6, 1.0)  # least and most


@dataclass(frozen=True)
class FaultKind:
    """What a kind of fault does, its targets, what its `value` means, what it needs, which rigs can have it."""

    summary: str
    targets: tuple[str, ...] = ("",)
    value: float = math.nan
    meaning: str = ""
    range: tuple[float, float] = (-math.inf, math.inf)
    needs: str = ""
    rigs: tuple[str, ...] = ()


LIES: Mapping[str, FaultKind] = {
    "drift": FaultKind("the value goes off at a steady speed", SENSORS, 0.005, "m/s or A/s", (-0.1, 0.1)),
    "jumped": FaultKind("the value is off from one moment to the next", SENSORS[:1], 0.004, "m", (-0.1, 0.1)),
    "sway": FaultKind("the value goes off and back in a sine of 8 s", SENSORS[:1], 0.01, "m", (-0.1, 0.1)),
    "flipped": FaultKind("the value's sign is the other one", SENSORS),
    "turned": FaultKind("the way since the lie began is the opposite of what it should be", _TOLD),
    "scaled": FaultKind("the way since then is so many times what it should be", _TOLD, 2.0, "times", (0.0, 10.0)),
    "held": FaultKind(
        "it stays where it was, or at `value`; a localiser's with its usual noise",
        _TOLD,
        meaning="m, A, or share of the level",
        range=(-5.0, 5.0),
    ),
    "late": FaultKind("readings are so old when they are told, and say so", SENSORS[:1], 0.12, "s", (1e-3, 0.4)),
    "late_unsaid": FaultKind("readings are so old, told as fresh", SENSORS[:1], 0.12, "s", (1e-3, 0.4)),
    "swapped": FaultKind(
        "the place of carriage or inner mass is told as the capsule's",
        SENSORS[:1],
        rigs=(CARRIAGE.name, INNER_MASS.name),
    ),
    "foreign": FaultKind("a smooth motion of another rig is told", SENSORS[:1], 0.01, "m either way", (1e-4, 0.5)),
    "noisy": FaultKind("the noise is so many times as large", SENSORS[:1], 10.0, "times", (1.0, 100.0)),
    "coarse": FaultKind("the value comes in steps", SENSORS[:1], 0.002, "m", (1e-6, 0.1)),
    "sticks": FaultKind(
        "the carriage sticks until it is so far behind, and jumps there",
        (DRIVE,),
        0.005,
        "m",
        (1e-5, 0.1),
        rigs=(CARRIAGE.name,),
    ),
    "restless": FaultKind(
        "the drive moves by itself while it is not enabled, and reports it",
        (DRIVE,),
        0.02,
        "m/s, A, or share of the level",
        (-2.0, 2.0),
    ),
}
"""Frames that are valid in form and false in content, and drives that do what they were not asked."""
KINDS: Mapping[str, FaultKind] = {
    "drop": FaultKind("frames are lost on their way", _WAYS, 1.0, "share of the frames", _SHARE),
    "delay": FaultKind("frames come late", _WAYS, 0.03, "s", (1e-4, 10.0)),
    "duplicate": FaultKind("frames come twice", _WAYS),
    "reorder": FaultKind("each two frames change places", _WAYS),
    "corrupt": FaultKind(
        "bits of frames are flipped behind the bus's own check", _WAYS, 1.0, "share of the frames", _SHARE
    ),
    "replay": FaultKind("old frames come again between the true ones", _WAYS, 20.0, "frames ago", (1, 32)),
    "retyped": FaultKind("frames come as extended, remote, error or FD frames (FD ones: classic) in turn", _WAYS),
    "unreadable": FaultKind("the node's interface raises whenever it is read", NODES[:2]),
    "second_master": FaultKind("another controller speaks on the bus: time, heartbeat, commands that enable"),
    "player": FaultKind("what the controller has said since the run began is played on the bus"),
    "babbling": FaultKind("a node sends identifier 0, which goes before all others, without pause"),
    "bus_off": FaultKind("a node leaves the bus by its error counters", NODES),
    "stuck": FaultKind("the sensor repeats its last value", SENSORS),
    "biased": FaultKind("the sensor is off", SENSORS, 0.01, "m or A", (-1.0, 1.0)),
    "nan": FaultKind("the sensor has no number", SENSORS[:1]),
    "lost": FaultKind("the localisation says nothing", SENSORS[:1]),
    "over_temperature": FaultKind("the drive gets hot", value=60.0, meaning="degC", range=(-40.0, 150.0)),
    "drive_reset": FaultKind("the drive boots anew"),
    "encoder_error": FaultKind("the drive's encoder tells nothing", needs=MAKER),
    "wrong_node": FaultKind("the drive answers to another node's number", needs=MAKER),
    "wrong_bit_rate": FaultKind("the drive's end of the bus goes at another bit rate", needs=MAKER),
    "killed": FaultKind("the controller's process is gone"),
    "frozen": FaultKind("the controller's process stands still"),
    "late_solve": FaultKind("the controller's solutions come too late"),
    "released": FaultKind("the operator lets the dead-man switch go, for good", needs=OPERATOR),
    "held_back": FaultKind(
        "a gateway holds each setpoint back for longer than the one before",
        (SETPOINTS,),
        0.01,
        "s longer",
        (1e-4, 10.0),
        OPERATOR,
    ),
    "frozen_setpoint": FaultKind("the operator's node repeats one frame", (SETPOINTS,), needs=OPERATOR),
    "miscounted": FaultKind("counters of setpoints are 8 off, their CRC fits", (SETPOINTS,), needs=OPERATOR),
    "out_of_range": FaultKind("positions of setpoints are out of range", (SETPOINTS,), needs=OPERATOR),
    "beyond_limits": FaultKind("setpoints ask for 0.4 m/s", (SETPOINTS,), needs=OPERATOR),
    "second_operator": FaultKind(
        "somebody else steers, too: as another source, or as the same one", ("other", "same"), needs=OPERATOR
    ),
    "forged": FaultKind("frames have a wrong authenticator", _KEYED, needs=KEY),
    "wrong_key": FaultKind("frames are authenticated with another key", _KEYED, needs=KEY),
    "recorded": FaultKind(
        "genuine frames of before, whose counters fit, come in place of the true ones", _KEYED, needs=KEY
    ),
    "unkeyed": FaultKind("frames are classic ones, without an authenticator", _KEYED, needs=KEY),
    "epoch_back": FaultKind("the sender has begun anew with an earlier epoch", _KEYED, needs=KEY),
    "clock_jump": FaultKind("the controller's clock jumps", value=0.5, meaning="s", range=(-1000.0, 1000.0)),
    **LIES,
}


@dataclass(frozen=True)
class Fault:
    """One fault; a lie lasts where nothing is said. A drift ends once it is `size_m`."""

    kind: str
    at_s: float
    duration_s: float = math.nan
    target: str = ""
    value: float = math.nan
    size_m: float = math.nan

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(
                f"faults.kind must be one of {', '.join(KINDS)}; got {self.kind!r}; {nearest(self.kind, KINDS)}"
            )
        known = KINDS[self.kind]
        if self.target and self.target not in known.targets:
            choices = ", ".join(t for t in known.targets if t)
            raise ValueError(
                f"faults.target of {self.kind} must be {f'one of {choices}' if choices else 'left out'}; got"
                f" {self.target!r}"
            )
        if not 0 <= self.at_s < math.inf:
            raise ValueError(f"faults.at_s must be zero or more; got {self.at_s:g}")
        if math.isnan(self.duration_s):
            object.__setattr__(self, "duration_s", math.inf if self.kind in LIES else 0.2)
        if not self.duration_s > 0:
            raise ValueError(f"faults.duration_s must be positive; got {self.duration_s:g}")
        if not math.isnan(self.value) and not (known.meaning and math.isfinite(self.value)):
            raise ValueError(
                f"faults.value of {self.kind} must be {f'a number ({known.meaning})' if known.meaning else 'left out'};"
                f" got {self.value:g}"
            )
        least, most = known.range
        if known.meaning and not (math.isnan(self.amount) or least <= self.amount <= most):
            raise ValueError(
                f"faults.value of {self.kind} must lie in [{least:g}, {most:g}] ({known.meaning}); got {self.value:g}"
            )
        if self.kind == "replay" and self.amount != int(self.amount):
            raise ValueError(f"faults.value of replay must be a whole number of frames; got {self.value:g}")
        if not math.isnan(self.size_m) and not (self.kind == "drift" and 0 < self.size_m < math.inf):
            wanted = "a positive number of m" if self.kind == "drift" else "left out"
            raise ValueError(f"faults.size_m of {self.kind} must be {wanted}; got {self.size_m:g}")
        object.__setattr__(self, "target", self.target or known.targets[0])

    @property
    def amount(self) -> float:
        """The `value`, or the kind's own where none is given."""
        return KINDS[self.kind].value if math.isnan(self.value) else self.value

    @property
    def needs(self) -> str:
        """What the scenario must have for it."""
        return OPERATOR if self.target == SETPOINTS else KINDS[self.kind].needs

    def check_rig(self, kind: str) -> None:
        """Raises ValueError for a `kind` of rig that cannot have it."""
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
    """The faults of a scenario in order of time. Raises ValueError, one sentence, that names the key."""
    if not isinstance(tables, Sequence) or isinstance(tables, str) or not all(isinstance(t, Mapping) for t in tables):
        raise ValueError(f"faults must be tables [[faults]]; got {tables!r}")
    found = sorted((from_table(Fault, t, "faults") for t in tables), key=lambda f: f.at_s)
    for fault in found:
        if fault.at_s >= duration_s:
            raise ValueError(f"faults.at_s must lie within the run of {duration_s:g} s; got {fault.at_s:g}")
    return tuple(found)


def read_lie(text: str) -> Fault:
    """A lie as it is typed: `KIND[:TARGET][=VALUE][@AT_S]`. Raises ValueError for one that is none."""
    found = re.fullmatch(r"(\w+)(?::(\w+))?(?:=([^@]+))?(?:@(.+))?", text)
    try:
        kind, target, value, at_s = found.groups() if found else ("", "", "", "")
        if kind not in LIES:
            raise ValueError(f"the kind must be one of {', '.join(LIES)}; {nearest(kind, LIES)}")
        return Fault(kind, float(at_s or 0.0), math.inf, target or "", float(value) if value else math.nan)
    except ValueError as error:
        raise ValueError(f"--lie must be KIND[:TARGET][=VALUE][@AT_S], of a lie; got {text!r}: {error}") from None
