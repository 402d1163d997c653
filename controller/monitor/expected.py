"""What a monitor expects of a model that holds, by drive, from simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Expected:
    """Of seconds in which the capsule moves by `least_m` or more: `miss_m` is the standard deviation of the forecast's
    miss beside what begin and end are uncertain by, `innovation` that of the mean standardised innovation, `lacking`
    that of the force that the model lacks, as a share of its mean friction.
    `forecast`, `innovations` and `drift` are the evidence that raises an alarm.
    """

    least_m: float = 0.2e-3
    miss_m: float = 0.2e-3
    innovation: float = 0.2
    lacking: float = 0.1
    forecast: float = 15.0
    innovations: float = 15.0
    drift: float = 30.0


EXPECTED: Mapping[str, Expected] = MappingProxyType({"magnetic": Expected(), "coil": Expected(), "vibro": Expected()})
