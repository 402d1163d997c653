"""What a run's JSON object and its summary say of the monitor's verdict on the model in use."""

import math
from collections.abc import Mapping
from typing import Any

from controller.monitor.monitor import Health


def told(health: Health, origin_s: float = 0.0) -> dict[str, Any]:
    """The object `monitor` of a run's JSON object; times in s of the reference's time, which began at `origin_s`."""
    since = health.since_s - origin_s if math.isfinite(origin_s) else 0.0
    return {
        "state": health.state,
        "since_s": max(since, 0.0),
        "alarms": health.alarms,
        "change": health.change or None,
        "evidence": health.evidence,
    }


def health_words(found: Mapping[str, Any]) -> str:
    """The same in words."""
    monitor = found["monitor"]
    state, since = monitor["state"], monitor["since_s"]
    if state == "not watched":
        return "model: not watched, as the controller uses none"
    if state != "broken":
        return f"model {'holds' if state == 'holds' else 'doubtful'} ({100 * monitor['evidence']:.0f} % of an alarm)"
    return f"model broken since {since:.1f} s, a {monitor['change']} change"
