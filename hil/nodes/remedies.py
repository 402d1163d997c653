"""What helps where a controller did not lead or stopped early, by the words of the reason."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from hil.nodes.receive import SAFE_STOP
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
REASONS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "safe_stop": (SAFE_STOP,),
        "other": ("another controller is on the bus",),
        "twins": ("two drives of", "two localisers", "heartbeat refused"),
        "contradict": ("sensor or drive contradict",),
        "rest": ("the drive does not rest",),
        "fault": ("drive fault", "the drive is in fault"),
        "catalogue": ("another DBC",),
        "feedback": ("feedback", "drive heartbeat lost", "no heartbeat", "bus: 0 good frames"),
        "model": ("the localisation had jumped",),
        "localiser": ("localisation",),
        "drive": ("nothing received",),
        "processor": ("controller late", "controller paused", "clock jumped"),
        "follow": ("drive does not follow",),
        "left": ("drive left operation", "drive not enabled", "the drive is in its quick stop"),
        "enable": ("the drive boots", "self test", "in standby", "the drive is ready", "did not become ready"),
        "limits": ("limited too long",),
        "swings": ("swings about",),
        "chain": ("must lead 99 %",),
    }
)
"""By the key of its sentence, what a reason has in it; the first that fits counts."""


def remedy(ended: str) -> str:
    fits = (key for key, parts in REASONS.items() if any(part in ended for part in parts))
    key = next(fits, "")
    return TEXT(f"remedy.{key}") if key else ""
