"""Which stop the inner mass strikes in a cycle: none, the front one, the rear one or both."""

from __future__ import annotations

from typing import Literal

from controller.vibro.cycles import Pace, VibroModel

Impact = Literal["none", "front", "rear", "both"]
IMPACTS: tuple[Impact, ...] = ("none", "front", "rear", "both")


def impact_of(model: VibroModel, pace: Pace) -> Impact:
    """The stops of `model` that lie within the swings of `pace`."""
    front = model.drive.front is not None and pace.front_m > model.drive.front.gap_m
    rear = model.drive.rear is not None and pace.rear_m > model.drive.rear.gap_m
    return IMPACTS[front + 2 * rear]
