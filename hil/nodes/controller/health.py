"""The monitor's word on the model in use, as the frame ModelHealth says it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from controller.monitor.monitor import Health

HEALTH_S: Final = 0.1
STATES: Final[Mapping[str, int]] = MappingProxyType({"holds": 0, "doubtful": 1, "broken": 2, "not watched": 3})
CHANGES: Final[Mapping[str, int]] = MappingProxyType({"": 0, "sudden": 1, "slow": 2})
_LONGEST_S: Final = 167772.0
_MOST: Final = 2.55


def health_values(health: Health, began_s: float) -> dict[str, float]:
    """The signals of ModelHealth; times count from `began_s`, when the node began."""
    return {
        "State": STATES[health.state],
        "Change": CHANGES[health.change],
        "Since_s": min(max(health.since_s - began_s, 0.0), _LONGEST_S),
        "Evidence": min(max(health.evidence, 0.0), _MOST),
        "Alarms": min(health.alarms, 255),
    }
