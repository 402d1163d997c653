"""Why a drive was not enabled: the one sentence of a run that gave up, or that found its cause after its end."""

import math
from typing import Final

from hil.nodes.frame_map import BOOT, FAULT, SELF_TEST, STANDBY, STOPPING, WAITING
from hil.nodes.node import ControllerNode

_STATES: Final = {
    BOOT: "boots",
    SELF_TEST: "is in its self test",
    STANDBY: "stays in standby",
    WAITING: "is ready, and was not enabled",
    STOPPING: "is in its quick stop",
    FAULT: "is in fault",
}


def why_not_enabled(node: ControllerNode, now: float, lost: bool) -> str:
    """What was missing at `now`; `lost` says whether the estimate was. Refusals are told where they are the cause."""
    receiver, fence = node.receiver, node.guard.fence
    seen = receiver.evidence(now)
    refused = f"; {words}" if (words := receiver.refused_words) else ""
    if seen.localisation_s == math.inf:
        return f"no localisation that counts has been heard{refused}"
    if seen.localisation_s > fence.stop_s:
        told = receiver.age_s > fence.stop_s
        came = f"localisation is told as {_ms(receiver.age_s)} old" if told else ""
        came = came or f"the newest localisation came {_ms(seen.localisation_s)} ago"
        return f"{came}, and may be {_ms(fence.stop_s)} old{refused}"
    if seen.feedback_s > fence.feedback_s:
        return f"the newest feedback of the drive is {_ms(seen.feedback_s)} old{refused}"
    if lost:
        return f"the estimate is lost: {_why_lost(node)}"
    return f"the drive {_STATES.get(seen.state, 'did not become ready')}{refused}"


def _why_lost(node: ControllerNode) -> str:
    counts = node.estimator.counts
    return (
        f"of the localisations {counts.accepted} were as expected, {counts.outliers} were not, {counts.unusable} came"
        " too late to be used"
    )


def _ms(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds >= 1.0 else f"{1e3 * seconds:.0f} ms"
