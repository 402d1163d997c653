"""The frame map: the frames and signals of each kind of rig, and the meaning of its drive's numbers."""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import Final

import can

from controller.drives import CARRIAGE, COIL, INNER_MASS, Driven
from hil.bus.catalogue import FrameCatalogue, load_catalogue
from models.parameter import nearest

Observer = Callable[[can.Message], object]  # Gets every frame of a node, with its timestamp
OFF, READY, ENABLE, QUICK_STOP = range(4)  # modes of a command
BOOT, SELF_TEST, STANDBY, WAITING, ENABLED, DERATED, STOPPING, FAULT = range(8)
"""States of a drive, in the numbers of its feedback; `WAITING` is "ready", `STOPPING` "quick_stop"."""
MOVING: Final = (ENABLED, DERATED)
NO_FAULT, OVER_CURRENT, OVER_TEMPERATURE, OVER_SPEED, TIME_TO_LIVE, HEARTBEAT_LOST = range(6)
SENSOR, BUS_OFF, SUPPLY, SELF_TEST_FAILED, INTERNAL = range(7, 12)  # codes of faults, in the numbers of fault frames
IN_HEARTBEAT: Final = (0, 0, 1, 1, 2, 2, 3, 4)  # states of a drive, in the numbers of heartbeats
LONGEST_S: Final = 167772.0  # upper end of the range of times in frames
FASTEST_M_S: Final = 0.4  # upper end of the range of speeds in frames
QUICK_STOP_M_S2: Final = 25.0  # braking of the carriage without a command: from its 0.25 m/s to rest in 10 ms


@dataclass(frozen=True)
class FrameMap:
    """One `drive` on the bus, named `node`. Its `signal` is the column `channel` of records. The signal `still` of its
    feedback rests while the drive is disabled. `target` is its number in SafeStop and DriveReset. `bounds` pairs the
    command's signals with their limits. `command` to `challenge` name its frames.

    A command is valid for `life_ms`. The drive reaches its safe state (carriage at rest, no current, inner mass off)
    within `stops_s` of the last command, braking included, and within `seen_s` of the last good feedback. `feedback_s`
    is the maximum age of the feedback of a drive at rest: a tick, the delay of the stop and the decay of a coil's
    current are already subtracted.
    """

    drive: Driven
    node: str
    signal: str
    channel: str
    target: int
    still_ms: int
    feedback_s: float
    still: str = "Current_A"
    bounds: tuple[tuple[str, str], ...] = ()
    stops_s: float = 0.010
    seen_s: float = 0.010
    braking_m_s2: float = math.inf

    command: str = field(init=False)
    feedback: str = field(init=False)
    fault: str = field(init=False)
    heartbeat: str = field(init=False)
    challenge: str = field(init=False)

    def __post_init__(self) -> None:
        for part in ("Command", "Feedback", "Fault", "Heartbeat", "Challenge"):
            object.__setattr__(self, part.lower(), self.node + part)

    def state_name(self, state: int) -> str:
        return frames()[self.feedback].field("State").names[state]

    def life_ms(self, rate: float) -> int:
        """Time to live in ms, at least 6, of a command that changes by `rate` per second; excludes the braking time."""
        return max(int(self.still_ms - 1e3 * abs(rate) / self.braking_m_s2), 6)

    def values(self, command: float, rate: float, mode: int) -> dict[str, float]:
        """The signals of a command frame for `command` in the drive's unit, which changes by `rate` per second."""
        values = {self.signal: command, "TimeToLive_ms": self.life_ms(rate), "Mode": mode}
        if self.drive.placed:
            values["Velocity_m_s"] = min(max(rate, -FASTEST_M_S), FASTEST_M_S)
        elif self.drive.shaken:
            values |= {"Period_s": 0.0, "Duty": 0.0}
        return values


def heartbeat(state: int, up_s: float) -> dict[str, float]:
    """The signals of the heartbeat of a node in `state` (heartbeat's numbers) after `up_s` of running."""
    return {"State": state, "Uptime_s": min(max(up_s, 0.0), LONGEST_S), "Catalogue": frames().fingerprint}


def answer_of(number: int, target: int) -> int:
    """The answer to a challenge: CRC-32 of `number` (4 bytes, little endian) and `target`."""
    return zlib.crc32(number.to_bytes(4, "little") + bytes([target]))


CARRIAGE_MAP: Final = FrameMap(
    CARRIAGE,
    "Carriage",
    "Position_m",
    "carriage_position_m",
    1,
    18,
    0.0215,
    still="Position_m",
    bounds=(("Position_m", "travel_m"), ("Velocity_m_s", "carriage_speed_m_s")),
    stops_s=0.020,
    seen_s=0.025,
    braking_m_s2=QUICK_STOP_M_S2,
)
COIL_MAP = FrameMap(COIL, "Coil", "Current_A", "coil_current_A", 2, 6, 0.0045, bounds=(("Current_A", "current_A"),))
INNER_MASS_MAP: Final = FrameMap(INNER_MASS, "InnerMass", "Level", "drive_on", 3, 6, 0.0065)
FRAME_MAPS: Final = MappingProxyType({one.drive.name: one for one in (CARRIAGE_MAP, COIL_MAP, INNER_MASS_MAP)})


def frame_map_of(kind: str) -> FrameMap:
    """The frame map of a kind of rig. Raises ValueError for one without a drive on the bus."""
    if kind not in FRAME_MAPS:
        known, hint = ", ".join(FRAME_MAPS), nearest(kind, FRAME_MAPS)
        raise ValueError(f"rig.kind must be one of {known} on the bus; got {kind!r}; {hint}")
    return FRAME_MAPS[kind]


def controllers_frames() -> dict[int, str]:
    """Identifiers and names of the frames that only a controller sends."""
    return {frame.id: frame.name for frame in frames().frames.values() if frame.sender == "Controller"}


@cache
def frames() -> FrameCatalogue:
    """The project's own catalogue, read once."""
    return load_catalogue()
