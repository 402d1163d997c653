"""How soon a drive must be in its safe state after each fault."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from hil.nodes.fault import KINDS, Fault

TO_LIVE_S: Final[Mapping[str, float]] = MappingProxyType({"magnetic": 0.020, "coil": 0.010, "vibro": 0.010})
"""From the last good command frame to the safe state, for each kind of rig."""
SEEN_S: Final[Mapping[str, float]] = MappingProxyType({"magnetic": 0.025, "coil": 0.010, "vibro": 0.010})
"""From the last good feedback."""
BUS_S: Final = 0.02
STUCK_S: Final = 0.05
PLACE_S: Final = 0.155
"""150 ms without localisation, and the next tick's way to the drive."""
_RIDDEN: Final = ("duplicate", "reorder", "replay")
_UNSEEN: Final = (("coil", "biased"), ("vibro", "stuck"), ("vibro", "biased"))
_OWN_S: Final[Mapping[str, float]] = MappingProxyType(
    {"babbling": BUS_S, "over_temperature": 0.5, "drive_reset": 0.02, "late_solve": 0.02, "clock_jump": 0.02}
)


def limit_s(rig: str, fault: Fault) -> float:
    """The longest time in s from the fault's begin to the safe state, inf where the loop may ride through: doubled and old frames, of frames
    that changed places each second one is taken; a report that nothing acts on; and a fault weaker than its kind's own value."""
    kind, target = fault.kind, fault.target
    if kind in _RIDDEN or (kind, target) == ("delay", "localisation") or (target == "feedback" and (rig, kind) in _UNSEEN):
        return math.inf
    if abs(fault.amount) < KINDS[kind].value:
        return math.inf
    if kind in _OWN_S:
        return _OWN_S[kind]
    if kind in ("killed", "frozen") or (kind in ("drop", "delay", "corrupt") and target in ("commands", "all")):
        return TO_LIVE_S[rig]
    if kind == "bus_off" and target in ("controller", "drive"):
        return BUS_S
    if kind == "stuck" or (kind, target) == ("biased", "feedback"):
        return STUCK_S
    return SEEN_S[rig] if target == "feedback" else PLACE_S
